"""Where the robot can stand: floor positions connected to its start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy import ndimage

from hgs_core.errors import SceneError
from hgs_core.scene.free_floor import floor_under
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.ray_caster import RayCaster

GRID_M: Final = 0.25
"""Spacing of the positions that are returned."""
_CELLS_PER_GRID: Final = 5
"""Connectivity is decided on a grid finer by this factor, so that doors need no luck with the raster."""
_START_TOLERANCE_CELLS: Final = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class ReachableFloor:
    """A raster of 5 cm in world coordinates: cell `(i, j)` is centred at `(first_cell + (i, j)) * cell_m`."""

    cells: Bool[ndarray, "n_x n_y"]
    """Where the robot's axis can be."""
    first_cell: Int[ndarray, " 2"]
    cell_m: float = GRID_M / _CELLS_PER_GRID

    def positions_m(self, spacing_m: float = GRID_M) -> Float[ndarray, "n 2"]:
        """The reachable multiples of `spacing_m`, itself a multiple of the cell, sorted."""
        cells = np.argwhere(self.cells) + self.first_cell
        return cells[np.all(cells % round(spacing_m / self.cell_m) == 0, axis=1)] * self.cell_m

    def index_of(self, positions_m: Float[ndarray, "*points 2"]) -> Int[ndarray, "*points 2"]:
        """The cells that positions lie in; they may lie outside the raster."""
        return np.rint(positions_m / self.cell_m).astype(np.int64) - self.first_cell


def reachable_positions(
    caster: RayCaster, *, start_xy: tuple[float, float], radius_m: float, height_m: float
) -> Float[ndarray, "n 2"]:
    """Multiples of 0.25 m where an upright cylinder can stand and can get to from `start_xy`, sorted.

    See `reachable_floor`, which raises the same `SceneError`.
    """
    return reachable_floor(caster, start_xy=start_xy, radius_m=radius_m, height_m=height_m).positions_m()


def reachable_floor(
    caster: RayCaster, *, start_xy: tuple[float, float], radius_m: float, height_m: float
) -> ReachableFloor:
    """Where an upright cylinder can stand and can get to from `start_xy`.

    A place is free when nothing between wheel height and `height_m` is nearer than `radius_m` to the
    cylinder's axis, and there is floor under it. Places are connected through free
    neighbours 5 cm apart. Raises `SceneError` when the start itself is not free.
    """
    free, first_cell = _free_cells(caster, radius_m=radius_m, height_m=height_m)
    cell_m = GRID_M / _CELLS_PER_GRID
    start = np.round(np.array(start_xy) / cell_m).astype(int) - first_cell
    offsets = np.argwhere(free) - start
    nearest = np.abs(offsets).max(axis=1).min() if len(offsets) else np.inf
    if nearest > _START_TOLERANCE_CELLS:
        raise SceneError(
            f"the start ({start_xy[0]:.2f}, {start_xy[1]:.2f}) m is not a place where a robot of radius "
            f"{radius_m} m and height {height_m} m can stand"
        )
    labels, _ = ndimage.label(free)
    anchor = start + offsets[np.abs(offsets).max(axis=1).argmin()]
    return ReachableFloor(cells=labels == labels[tuple(anchor)], first_cell=first_cell)


def _free_cells(
    caster: RayCaster, *, radius_m: float, height_m: float
) -> tuple[Bool[ndarray, "n_x n_y"], ndarray]:
    """Which cells of the fine grid are free, and the integer coordinates of cell (0, 0)."""
    bounds = caster.mesh.bounds()
    cell_m = GRID_M / _CELLS_PER_GRID
    first = np.floor(bounds.lower_m[:2] / cell_m).astype(int)
    last = np.ceil(bounds.upper_m[:2] / cell_m).astype(int)
    grid = np.stack(
        np.meshgrid(np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1), indexing="ij"),
        axis=-1,
    )
    centres = grid * cell_m
    free = BodyObstacles(caster.mesh, height_m).clearance_m(centres) > radius_m
    free[free] = floor_under(caster, centres[free], height_m)
    return free, first
