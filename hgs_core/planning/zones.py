"""The operator's areas as cells of a floor grid."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.geometry.polygons import Corners, contains, distance_m
from hgs_core.planning.directives import Directives
from hgs_core.robot.path import Path
from hgs_core.voxels.voxel_map import VoxelMap

_STEP_M: Final = 0.02
"""Spacing of the points of a path that are held against the areas."""
TOLERANCE_M: Final = 0.005
"""A path may come so much nearer to an area than the robot's radius: what rounding leaves."""


class Zones:
    """No-go areas and region of interest over the columns of a voxel map.

    A column is *forbidden* when its box meets a no-go area: when the area is nearer to its centre than half
    the box's diagonal. A column is *inside* the region when its centre is. Both are found once for as long as
    the map keeps its box: the same array again says that nothing has changed.
    """

    def __init__(self, directives: Directives) -> None:
        self._no_go_m = directives.no_go_m
        self._region_m = directives.region_m
        self._box: tuple[object, ...] | None = None
        self._forbidden: Bool[ndarray, "nx ny"] | None = None
        self._inside: Bool[ndarray, "nx ny"] | None = None

    def forbidden(self, voxels: VoxelMap) -> Bool[ndarray, "nx ny"] | None:
        """The forbidden columns; None without no-go areas."""
        self._fit(voxels)
        return self._forbidden

    def inside(self, voxels: VoxelMap) -> Bool[ndarray, "nx ny"] | None:
        """The columns inside the region; None without one."""
        self._fit(voxels)
        return self._inside

    def nearest_no_go_m(self, points_m: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
        """From each point to the nearest no-go area: exact; 0 in one, +inf without any."""
        nearest: Float[ndarray, " n"] = np.full(len(points_m), np.inf)
        for area in self._no_go_m:
            nearest = np.minimum(nearest, distance_m(area, points_m))
        return nearest

    def path_enters_no_go(self, path: Path, radius_m: float) -> bool:
        """Whether a disc that is driven along the path comes into a no-go area."""
        if not self._no_go_m or not len(path.positions_m):
            return False
        nearest = self.nearest_no_go_m(_along(path.positions_m))
        return bool(np.any(nearest < radius_m - TOLERANCE_M))

    def _fit(self, voxels: VoxelMap) -> None:
        shape = voxels.states.shape[:2]
        box = (shape, *voxels.origin_index[:2].tolist())
        if box == self._box:
            return
        self._box = box
        size = voxels.config.size_m
        lower = np.asarray(voxels.lower_m(), np.float64)[:2]
        if self._no_go_m:
            self._forbidden = np.zeros(shape, bool)
            for area in self._no_go_m:
                _mark(self._forbidden, area, lower, size, reach_m=size / np.sqrt(2.0))
        if self._region_m is not None:
            self._inside = np.zeros(shape, bool)
            _mark(self._inside, self._region_m, lower, size, reach_m=None)


def _mark(
    columns: Bool[ndarray, "nx ny"],
    area: Corners,
    lower_m: Float[ndarray, " 2"],
    size_m: float,
    *,
    reach_m: float | None,
) -> None:
    """Set the columns whose centres are at most so far from an area; None: those inside it."""
    margin = reach_m or 0.0
    first = np.floor((area.min(axis=0) - margin - lower_m) / size_m).astype(np.int64)
    last = np.ceil((area.max(axis=0) + margin - lower_m) / size_m).astype(np.int64)
    first, last = np.clip(first, 0, columns.shape), np.clip(last, 0, columns.shape)
    i, j = np.meshgrid(np.arange(first[0], last[0]), np.arange(first[1], last[1]), indexing="ij")
    centres = lower_m + (np.stack([i.ravel(), j.ravel()], axis=1) + 0.5) * size_m
    near = contains(area, centres) if reach_m is None else distance_m(area, centres) <= reach_m
    columns[i.ravel()[near], j.ravel()[near]] = True


def _along(positions_m: Float[ndarray, "n 2"]) -> Float[ndarray, "m 2"]:
    """Points of a polyline, its own among them, no farther apart than `_STEP_M`."""
    pieces = [positions_m[:1]]
    for a, b in itertools.pairwise(positions_m):
        n = max(1, int(np.ceil(np.linalg.norm(b - a) / _STEP_M)))
        pieces.append(a + (np.arange(1, n + 1) / n)[:, None] * (b - a))
    return np.concatenate(pieces)
