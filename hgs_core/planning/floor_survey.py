"""The navigation grid of the whole map, kept from cycle to cycle and rebuilt where the maps changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.planning.navigation_grid import (
    NavigationConfig,
    NavigationGrid,
    build_navigation_grid,
    clearance_reach_m,
)
from hgs_core.robot.robot import RobotConfig
from hgs_core.voxels.voxel_map import VoxelMap


class FloorSurvey:
    """Builds navigation grids whose cost follows what changed since the one before.

    A cell is what it would be in a grid built anew, but for one thing: far from the robot's places, Gaussians
    that moved or faded while keyframes were replayed are taken into account only when the robot is near
    again. (What it drives along is checked on a grid of its own, see `Pursuit.why_blocked`.)
    """

    def __init__(self, config: NavigationConfig, robot: RobotConfig, *, sight_m: float) -> None:
        self._config = config
        self._robot = robot
        self._sight_m = sight_m
        """How far from the robot Gaussians change when a frame is learnt."""
        self._grid: NavigationGrid | None = None
        self._version = -1
        self._robot_xy_m: Float[ndarray, " 2"] = np.zeros(2)
        self._touched_m: Float[ndarray, "n_touched 2"] = np.zeros((0, 2))
        self._forbidden: Bool[ndarray, "nx ny"] | None = None

    def grid(
        self,
        voxels: VoxelMap,
        gaussians: GaussianMap,
        *,
        robot_xy_m: Float[ndarray, " 2"],
        touched_m: Float[ndarray, "n_touched 2"],
        forbidden: Bool[ndarray, "nx ny"] | None = None,
    ) -> NavigationGrid:
        """The grid of the maps as they are now; see `build_navigation_grid`."""
        known = self._grid if forbidden is self._forbidden else None
        around_m = None
        if known is not None and _covers(known, voxels):
            around_m = self._changed_m(known, voxels, robot_xy_m, touched_m)
        grid = build_navigation_grid(
            voxels,
            self._config,
            self._robot,
            robot_xy_m=robot_xy_m,
            around_m=around_m,
            gaussians=gaussians,
            touched_m=touched_m,
            forbidden=forbidden,
        )
        if known is not None and around_m is not None:
            grid = _pasted(known, grid, around_m)
        self._grid, self._version = grid, voxels.version
        self._robot_xy_m, self._touched_m, self._forbidden = robot_xy_m, touched_m, forbidden
        return grid

    def _changed_m(
        self,
        known: NavigationGrid,
        voxels: VoxelMap,
        robot_xy_m: Float[ndarray, " 2"],
        touched_m: Float[ndarray, "n_touched 2"],
    ) -> Float[ndarray, "2 2"]:
        """Opposite corners of a rectangle that holds every cell that may differ from the known grid's."""
        places = np.stack([robot_xy_m, self._robot_xy_m])
        corners = [places - self._sight_m, places + self._sight_m, touched_m[len(self._touched_m) :]]
        changed = voxels.changed_columns(self._version)
        if changed is not None:
            corners.append(known.lower_m + np.array(changed) * known.size_m)
        points = np.concatenate(corners)
        reach = clearance_reach_m(known.clearance_cap_m, self._robot, known.size_m)
        return np.stack([points.min(axis=0) - reach, points.max(axis=0) + reach])


def _covers(grid: NavigationGrid, voxels: VoxelMap) -> bool:
    """Whether a grid is one of the whole map as it lies now."""
    return grid.shape == voxels.states.shape[:2] and bool(
        np.all(grid.lower_m == np.asarray(voxels.lower_m())[:2])
    )


def _pasted(known: NavigationGrid, part: NavigationGrid, corners_m: Float[ndarray, "2 2"]) -> NavigationGrid:
    """The known grid with the cells between two corners from `part`, which reaches farther on all sides."""
    offset = np.round((part.lower_m - known.lower_m) / known.size_m).astype(np.int64)
    cells: Int[ndarray, "2 2"] = np.floor((corners_m - known.lower_m) / known.size_m).astype(np.int64)
    low = np.clip(cells[0], 0, known.shape)
    high = np.clip(cells[1] + 1, low, known.shape)
    here = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
    there = tuple(slice(int(a), int(b)) for a, b in zip(low - offset, high - offset, strict=True))
    renewed = {}
    for name in ("blocked", "clearance_m", "soft_cost", "cost"):
        renewed[name] = getattr(known, name).copy()
        renewed[name][here] = getattr(part, name)[there]
    return replace(known, **renewed)
