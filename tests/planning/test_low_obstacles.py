"""What stands below the scanner's plane: seen in the Gaussian map, or felt."""

import numpy as np
import pytest

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.planning.low_obstacles import TouchMemory, low_surface_counts
from hgs_core.planning.navigation_grid import NavigationConfig, NavigationGrid, build_navigation_grid
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

ROBOT = DifferentialConfig()


def gaussians_at(centres: list[list[float]], *, logit_opacity: float = 3.0) -> GaussianMap:
    parameters = np.zeros((len(centres), 8), np.float32)
    parameters[:, :3] = centres
    parameters[:, 6] = np.log(0.01)
    parameters[:, 7] = logit_opacity
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    return gaussians


def free_floor(size_m: float = 0.1) -> VoxelMap:
    region = Box(lower_m=np.array([0.0, 0.0, -0.2]), upper_m=np.array([3.0, 3.0, 1.6]))
    voxels = VoxelMap(VoxelConfig(size_m=size_m), region=region)
    voxels.states[:] = VoxelState.FREE
    return voxels


def state(*, collisions: int, yaw_rad: float = 0.0) -> RobotState:
    return RobotState(
        x_m=1.5, y_m=1.5, yaw_rad=yaw_rad, timestamp_s=0.0, path_length_m=0.0, collisions=collisions
    )


def counts_of(gaussians: GaussianMap) -> np.ndarray:
    return low_surface_counts(
        gaussians, ROBOT, below_m=0.1, lower_m=np.array([-0.1, -0.5]), size_m=0.01, shape=(50, 100)
    )


def test_only_the_layer_between_step_and_column_counts() -> None:
    heights = [-0.01, 0.0, 0.03, 0.06, 0.06, 0.09, 0.12, 1.0]
    counts = counts_of(gaussians_at([[h + 0.005, 0.005, h] for h in heights]))
    np.testing.assert_array_equal(np.argwhere(counts), [[16, 50], [19, 50]])
    assert counts[16, 50] == 2


def test_faint_gaussians_empty_maps_and_what_lies_beside_the_plan_show_nothing() -> None:
    assert not counts_of(gaussians_at([[0.0, 0.0, 0.08]], logit_opacity=-2.0)).any()
    assert not counts_of(gaussians_at([[9.0, 0.0, 0.08], [0.0, -0.6, 0.08]])).any()
    assert not counts_of(GaussianMap()).any()


def test_a_sill_blocks_the_floor_on_which_the_voxels_see_nothing() -> None:
    voxels = free_floor()
    sill = gaussians_at([[2.05, y, 0.08] for y in np.arange(0.0, 3.0, 0.02)])
    here = np.array([1.0, 1.5])
    without = build_navigation_grid(voxels, NavigationConfig(), ROBOT, robot_xy_m=here)
    grid = build_navigation_grid(voxels, NavigationConfig(), ROBOT, robot_xy_m=here, gaussians=sill)
    assert not without.blocked.any()
    assert np.array_equal(np.unique(np.argwhere(grid.blocked)[:, 0]), [20])
    assert grid.blocked[20].all()
    # Cell (17, 15) is centred at x = 1.75 m, 0.25 m before the sill's cell; the next one is too near.
    assert grid.passable[17, 15]
    assert not grid.passable[18, 15]


@pytest.mark.parametrize("size_m", [0.1, 0.06, 0.05])
def test_two_gaussians_are_not_a_surface(size_m: float) -> None:
    stray = gaussians_at([[2.05, 1.55, 0.08], [2.06, 1.56, 0.08]])
    grid = build_navigation_grid(
        free_floor(size_m), NavigationConfig(), ROBOT, robot_xy_m=np.array([1.0, 1.5]), gaussians=stray
    )
    assert not grid.blocked.any()


@pytest.mark.parametrize("height_m", [0.08, 0.11])
@pytest.mark.parametrize("size_m", [0.06, 0.05])
def test_cells_of_fewer_gaussians_than_a_surface_has_are_judged_with_their_neighbours(
    size_m: float, height_m: float
) -> None:
    """4 cm apart, as on plain surfaces: one or two in a cell. And no height lies between them and voxels."""
    sill = gaussians_at([[2.05, y, height_m] for y in np.arange(0.0, 3.0, 0.04)])
    voxels = free_floor(size_m)
    grid = build_navigation_grid(
        voxels, NavigationConfig(), ROBOT, robot_xy_m=np.array([1.0, 1.5]), gaussians=sill
    )
    seen_by_voxels = height_m > 0.1 and size_m == 0.05  # whose column begins at 10 cm
    assert grid.blocked[int(2.05 / size_m), 2:-2].all() == (not seen_by_voxels)
    assert not grid.blocked[: int(1.9 / size_m)].any()


def beside_a_plant(tip_m: float, *, size_m: float = 0.1) -> tuple[VoxelMap, GaussianMap]:
    """A plant in the column of voxels from x = 2 m, and its leaf's tip, which ends at `tip_m` at a height of
    0.8 m, in a voxel that was seen free."""
    voxels = free_floor(size_m)
    voxels.states[round(2.0 / size_m), round(1.5 / size_m), round(1.0 / size_m)] = VoxelState.OCCUPIED
    tip = [[x, 1.54, 0.8] for x in np.arange(tip_m, 2.0, 0.002)]
    return voxels, gaussians_at(tip)


def grid_before(voxels: VoxelMap, gaussians: GaussianMap | None) -> NavigationGrid:
    here = np.array([1.0, 1.5])
    return build_navigation_grid(voxels, NavigationConfig(), ROBOT, robot_xy_m=here, gaussians=gaussians)


def test_a_leaf_that_reaches_out_of_its_voxel_blocks_where_the_robot_would_touch_it() -> None:
    """The middle of cell (17, 15) is 0.25 m from the plant's voxel, and 0.238 m from its leaf."""
    voxels, leaf = beside_a_plant(1.988)
    assert grid_before(voxels, None).passable[17, 15]
    grid = grid_before(voxels, leaf)
    assert np.argwhere(grid.blocked).tolist() == [[19, 15], [20, 15]]
    assert not grid.passable[17, 15]
    assert grid.passable[16, 15]


def test_a_leaf_that_nobody_would_touch_blocks_nothing() -> None:
    """Cells of 6 cm: the nearest place is 0.27 m from the plant's voxel."""
    voxels, leaf = beside_a_plant(1.988, size_m=0.06)
    without, grid = grid_before(voxels, None), grid_before(voxels, leaf)
    np.testing.assert_array_equal(grid.blocked, without.blocked)


def test_what_hangs_in_free_space_is_left_to_the_voxels() -> None:
    ghost = gaussians_at([[1.05 + 0.01 * k, 1.55, 0.8] for k in range(5)])
    assert not grid_before(free_floor(), ghost).blocked.any()


def test_a_touch_blocks_what_lies_ahead_once() -> None:
    touches = TouchMemory()
    touches.notice(state(collisions=0), ROBOT)
    assert len(touches.points_m) == 0
    touches.notice(state(collisions=1, yaw_rad=np.pi / 2), ROBOT)
    touches.notice(state(collisions=1, yaw_rad=0.0), ROBOT)
    away = touches.points_m - np.array([1.5, 1.5])
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 0.28)
    assert (away[:, 1] > 0.2).all()
    grid = build_navigation_grid(
        free_floor(), NavigationConfig(), ROBOT, robot_xy_m=np.array([1.5, 1.5]), touched_m=touches.points_m
    )
    assert grid.blocked[15, 17]
    restored = TouchMemory()
    restored.restore(touches.state())
    np.testing.assert_array_equal(restored.points_m, touches.points_m)
