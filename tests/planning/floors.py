"""Hand-made voxel maps: floors drawn as text."""

from __future__ import annotations

import numpy as np

from hgs_core.geometry.boxes import Box
from hgs_core.planning.navigation_grid import NavigationConfig, NavigationGrid, build_navigation_grid
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

HEIGHT = 15


def empty_map(nx: int, ny: int, nz: int = HEIGHT) -> VoxelMap:
    """All unobserved, from the origin."""
    upper = np.array([nx, ny, nz]) * 0.1
    return VoxelMap(VoxelConfig(), region=Box(lower_m=np.zeros(3), upper_m=upper))


def room(nx: int, ny: int) -> VoxelMap:
    """A seen, empty room with walls one voxel thick, a floor and no ceiling."""
    voxels = empty_map(nx, ny)
    voxels.states[:] = VoxelState.FREE
    voxels.states[[0, -1]] = VoxelState.OCCUPIED
    voxels.states[:, [0, -1]] = VoxelState.OCCUPIED
    voxels.states[:, :, 0] = VoxelState.OCCUPIED
    voxels.note_change()
    return voxels


def grid_of(
    voxels: VoxelMap, at: tuple[float, float] | None = None, radius_m: float = 0.25
) -> NavigationGrid:
    here = None if at is None else np.array(at)
    return build_navigation_grid(
        voxels, NavigationConfig(), DifferentialConfig(radius_m=radius_m), robot_xy_m=here
    )
