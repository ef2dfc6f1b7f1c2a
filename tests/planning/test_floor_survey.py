"""The kept navigation grid against one built anew."""

import numpy as np
import pytest

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.planning import floor_survey
from hgs_core.planning.floor_survey import FloorSurvey
from hgs_core.planning.navigation_grid import NavigationConfig, NavigationGrid, build_navigation_grid
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.voxels.voxel_map import CHUNK, VoxelConfig, VoxelMap

CONFIG, ROBOT = NavigationConfig(), DifferentialConfig()
SIGHT_M = 1.5


def large_map(rng: np.random.Generator) -> VoxelMap:
    region = Box(lower_m=np.array([-3.0, 2.0, 0.0]), upper_m=np.array([17.0, 18.0, 1.4]))
    voxels = VoxelMap(VoxelConfig(), region=region)
    voxels.states[:] = rng.choice(np.array([0, 1, 1, 1], np.uint8), voxels.states.shape)
    voxels.note_change()
    return voxels


def change_around(voxels: VoxelMap, xy_m: np.ndarray, rng: np.random.Generator) -> None:
    """Some voxels of the columns near a place, as a frame taken there would."""
    index, _ = voxels.index_of(np.array([[xy_m[0], xy_m[1], 0.5]]))
    low = np.maximum(index[0, :2] - 9, 0)
    near = voxels.states[low[0] : index[0, 0] + 9, low[1] : index[0, 1] + 9]
    near[rng.random(near.shape) < 0.02] = rng.integers(0, 3)
    voxels.version += 1
    voxels.changed_at[
        low[0] // CHUNK : (index[0, 0] + 9) // CHUNK + 1, low[1] // CHUNK : (index[0, 1] + 9) // CHUNK + 1
    ] = voxels.version


def sill_at(gaussians: GaussianMap, xy_m: np.ndarray, rng: np.random.Generator) -> None:
    rows = np.zeros((40, 8), np.float32)
    rows[:, :2] = xy_m + rng.uniform(-1.0, 1.0, (40, 2))
    rows[:, 2], rows[:, 6], rows[:, 7] = 0.07, np.log(0.01), 2.0
    gaussians.append(np.repeat(rows, 4, axis=0), anchor_keyframe=0)


def assert_same(one: NavigationGrid, other: NavigationGrid) -> None:
    for name in ("lower_m", "blocked", "clearance_m", "soft_cost", "cost"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize("seed", range(4))
def test_the_kept_grid_is_the_one_built_anew(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(seed)
    voxels, gaussians = large_map(rng), GaussianMap()
    survey = FloorSurvey(CONFIG, ROBOT, sight_m=SIGHT_M)
    built: list[NavigationGrid] = []

    def recorded(*arguments: object, **options: object) -> NavigationGrid:
        built.append(build_navigation_grid(*arguments, **options))  # type: ignore[arg-type]
        return built[-1]

    monkeypatch.setattr(floor_survey, "build_navigation_grid", recorded)
    robot = np.array([0.0, 4.0])
    touched = np.zeros((0, 2))
    for step in range(8):
        if step == 5:
            touched = np.array([robot + 0.3, robot - 4.0])
        grid = survey.grid(voxels, gaussians, robot_xy_m=robot, touched_m=touched)
        anew = build_navigation_grid(
            voxels, CONFIG, ROBOT, robot_xy_m=robot, gaussians=gaussians, touched_m=touched
        )
        assert_same(grid, anew)
        robot = robot + rng.uniform(0.2, 1.2, 2)
        change_around(voxels, robot, rng)
        sill_at(gaussians, robot - 0.2, rng)
    assert built[0].blocked.size == voxels.states[..., 0].size
    assert all(part.blocked.size < 0.4 * built[0].blocked.size for part in built[1:5])


def test_a_map_that_grew_is_surveyed_anew() -> None:
    rng = np.random.default_rng(9)
    survey = FloorSurvey(CONFIG, ROBOT, sight_m=SIGHT_M)
    none, robot = np.zeros((0, 2)), np.array([2.0, 5.0])
    survey.grid(large_map(rng), GaussianMap(), robot_xy_m=robot, touched_m=none)
    voxels = VoxelMap(VoxelConfig(), region=Box(lower_m=np.zeros(3), upper_m=np.array([20.0, 16.0, 1.4])))
    voxels.states[:] = 1
    voxels.note_change()
    grid = survey.grid(voxels, GaussianMap(), robot_xy_m=robot, touched_m=none)
    assert_same(grid, build_navigation_grid(voxels, CONFIG, ROBOT, robot_xy_m=robot))
