import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from hgs_core.geometry.boxes import Box
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import (
    CORNER_M,
    ENTRY_RADII_M,
    entries_within,
    off_the_walls,
    pairwise_costs,
    path_from_robot,
    reach_from,
    shortest_path,
)
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState
from tests.planning.floors import grid_of, room


def cluttered(seed: int) -> VoxelMap:
    rng = np.random.default_rng(seed)
    voxels = room(60, 50)
    for i, j in rng.integers(8, 42, (12, 2)):
        if max(abs(i - 5), abs(j - 5)) > 5:
            voxels.states[i : i + 3, j : j + 3, 1:8] = VoxelState.OCCUPIED
    return voxels


@settings(max_examples=25)
@given(seed=st.integers(0, 1000))
def test_paths_keep_clear_and_lead_where_they_should(seed: int) -> None:
    grid = grid_of(cluttered(seed))
    robot = np.array([0.52, 0.57])
    reach = reach_from(grid, robot)
    places = np.flatnonzero(reach.reachable.ravel())
    assert len(places) > 100
    for cell in np.random.default_rng(seed).choice(places, 8):
        path = path_from_robot(grid, reach, int(cell))
        goal = grid.centres_m(np.array([cell]))[0]
        assert np.array_equal(path[0], robot)
        np.testing.assert_allclose(path[-1], goal)
        assert grid.path_clearance_m(path).min() >= 0.25 - 1e-6
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() >= np.linalg.norm(goal - robot) - 1e-9


def straightened(grid: NavigationGrid, points: np.ndarray) -> list[int]:
    """What `NavigationGrid.straighten` does, line by line."""
    clear, cost = grid.check_segments(points[:-1], points[1:])
    total = np.concatenate([[0.0], np.cumsum(cost)])
    kept = [0]
    while kept[-1] < len(points) - 1:
        i = kept[-1]
        ends = np.arange(i + 2, len(points))
        line_clear, line_cost = grid.check_segments(np.tile(points[i], (len(ends), 1)), points[ends])
        run_clear = np.minimum.accumulate(clear[i:])[1:]
        required = np.minimum(grid.radius_m + grid.margin_m, run_clear) - 1e-6
        allowed = (line_clear >= required) & (line_cost <= 1.03 * (total[ends] - total[i]))
        kept.append(int(ends[allowed][-1]) if np.any(allowed) else i + 1)
    return kept


@settings(max_examples=15)
@given(seed=st.integers(0, 1000))
def test_straightening_is_that_of_the_oracle(seed: int) -> None:
    grid = grid_of(cluttered(seed))
    reach = reach_from(grid, np.array([0.52, 0.57]))
    places = np.flatnonzero(reach.reachable.ravel())
    for cell in np.random.default_rng(seed).choice(places, 4):
        points = grid.centres_m(reach.cells_to(int(cell)))
        assert grid.straighten(points, 1.03).tolist() == straightened(grid, points)


def test_a_straight_way_is_one_line() -> None:
    grid = grid_of(room(60, 50))
    start, goal = (int(c) for c in grid.cells_of(np.array([[1.05, 1.05], [4.55, 3.25]]))[0])
    path = shortest_path(grid, start, goal)
    assert path is not None
    assert path.tolist() == pytest.approx(np.array([[1.05, 1.05], [4.55, 3.25]]))


def test_where_there_is_room_the_margin_is_kept() -> None:
    voxels = room(60, 50)
    voxels.states[25:35, 10:40, 1:8] = VoxelState.OCCUPIED
    grid = grid_of(voxels)
    start, goal = (int(c) for c in grid.cells_of(np.array([[1.05, 2.55], [4.95, 2.55]]))[0])
    path = shortest_path(grid, start, goal)
    assert path is not None
    assert grid.path_clearance_m(path).min() >= 0.27


def test_no_way_through_a_gap_narrower_than_the_robot() -> None:
    for gap, passes in ((4, False), (6, True)):
        voxels = room(60, 50)
        voxels.states[30, :, 1:8] = VoxelState.OCCUPIED
        voxels.states[30, 20 : 20 + gap, 1:8] = VoxelState.FREE
        grid = grid_of(voxels)
        start, goal = (int(c) for c in grid.cells_of(np.array([[1.05, 2.25], [4.95, 2.25]]))[0])
        assert (shortest_path(grid, start, goal) is not None) == passes
        assert np.isfinite(pairwise_costs(grid, np.array([start, goal]))[0, 1]) == passes


def test_the_robot_leaves_a_place_that_became_too_tight() -> None:
    voxels = room(60, 50)
    voxels.states[22, 23:27, 1:8] = VoxelState.OCCUPIED  # its face at x = 2.3, the robot 0.17 m from it
    robot = np.array([2.47, 2.5])
    grid = grid_of(voxels, at=(2.47, 2.5))
    reach = reach_from(grid, robot)
    assert reach.escaping
    cell = int(grid.cells_of(np.array([[4.05, 2.55]]))[0][0])
    path = path_from_robot(grid, reach, cell)
    assert grid.path_clearance_m(path).min() >= 0.17 - CORNER_M  # hardly nearer than it stands


def test_a_walled_in_robot_reaches_nothing() -> None:
    voxels = room(60, 50)
    voxels.states[[20, 30], 20:31, 1:8] = VoxelState.OCCUPIED
    voxels.states[20:31, [20, 30], 1:8] = VoxelState.OCCUPIED
    voxels.states[21:30, 21:30] = VoxelState.UNOBSERVED
    grid = grid_of(voxels, at=(2.55, 2.55))
    inside = np.flatnonzero(reach_from(grid, np.array([2.55, 2.55])).reachable.ravel())
    assert np.all(np.linalg.norm(grid.centres_m(inside) - 2.55, axis=1) < 0.5)


def test_a_path_keeps_to_the_middle_of_an_aisle_of_an_even_number_of_cells() -> None:
    grid = grid_of(room(40, 8))  # 0.6 m wide: every centre near the middle is 0.25 m from one wall
    row = np.array([cell * 8 + 3 for cell in range(4, 35)])
    points = grid.centres_m(row)
    assert grid.path_clearance_m(points).max() < 0.26
    moved = off_the_walls(grid, points)
    assert np.array_equal(moved[[0, -1]], points[[0, -1]])
    np.testing.assert_allclose(moved[1:-1, 1], 0.4)
    assert grid.path_clearance_m(moved[1:-1]).min() > 0.29


def test_a_roomy_path_stays_where_it_is() -> None:
    grid = grid_of(room(40, 40))
    points = grid.centres_m(np.array([cell * 40 + 20 for cell in range(6, 34)]))
    assert off_the_walls(grid, points) is points


def test_the_way_out_of_a_tight_place_does_not_make_the_rest_of_the_path_tight() -> None:
    """The robot stands 10 cm from a box; what it passes later is passed at its radius."""
    voxels = room(60, 60)
    voxels.states[5:7, 5:8, :12] = VoxelState.OCCUPIED
    voxels.states[10:20, 12:18, :12] = VoxelState.OCCUPIED
    voxels.note_change()
    robot = np.array([0.8, 0.8])
    grid = grid_of(voxels, (0.8, 0.8))
    reach = reach_from(grid, robot)
    assert reach.escaping
    tight = float(grid.path_clearance_m(robot[None])[0])
    for cell in np.flatnonzero(reach.reachable.ravel())[::7].tolist():
        path = path_from_robot(grid, reach, cell)
        clearance, _ = grid.check_segments(path[:-1], path[1:])
        assert clearance[0] >= tight - CORNER_M
        assert np.all(clearance[1:] >= grid.radius_m - 1e-6)
        assert np.hypot(*(path[1] - robot)) <= max(ENTRY_RADII_M) + grid.size_m


def test_a_line_that_just_fits_between_two_corners_leads_out_of_a_pocket() -> None:
    """A desk's corner and a sill's, as a mission met them: cells of 6 cm leave one diagonal step between."""
    blocked = np.zeros((45, 19), bool)
    blocked[:3] = blocked[:, 15:] = True
    blocked[3:16, :5] = True
    blocked[15:, 14] = True
    blocked[20:, 13] = True
    blocked[:, :1] = blocked[-1:] = True
    region = Box(lower_m=np.zeros(3), upper_m=np.array([45 * 0.06, 19 * 0.06, 1.5]))
    voxels = VoxelMap(VoxelConfig(size_m=0.06), region=region)
    voxels.states[:] = np.where(blocked[..., None], VoxelState.OCCUPIED, VoxelState.FREE)
    voxels.note_change()
    here = (9.5 * 0.06, 9.5 * 0.06)
    grid = grid_of(voxels, at=here)
    assert label(grid.passable)[1] > 1, "this test wants passable cells in pieces"
    reach = reach_from(grid, np.array(here))
    assert reach.reachable.sum() == grid.passable.sum()
    goal = int(np.flatnonzero(grid.passable)[-1])
    path = path_from_robot(grid, reach, goal)
    np.testing.assert_allclose(path[-1], grid.centres_m(np.array([goal]))[0])
    assert grid.path_clearance_m(path).min() >= grid.radius_m - 1e-6
    assert reach.lengths_m(grid)[goal] >= np.linalg.norm(path[-1] - path[0]) - 1e-9


def test_a_robot_in_a_waist_finds_the_way_that_it_came_by_not_only_the_pocket_beside_it() -> None:
    """It stands 0.22 m from a corner: within 0.3 m lies a dead end alone, and a room 0.42 m off."""
    free = np.zeros((45, 70), bool)
    free[10:20, 4:20] = free[12:20, 20:25] = free[2:43, 25:68] = True  # dead end, waist of 0.48 m, room
    region = Box(lower_m=np.zeros(3), upper_m=np.array([45 * 0.06, 70 * 0.06, 1.5]))
    voxels = VoxelMap(VoxelConfig(size_m=0.06), region=region)
    voxels.states[:] = np.where(free[..., None], VoxelState.FREE, VoxelState.OCCUPIED)
    voxels.note_change()
    here = np.array([0.94, 1.23])
    grid = grid_of(voxels, at=(0.94, 1.23))
    near, _ = entries_within(grid, here, ENTRY_RADII_M[0])
    assert len(near)
    assert np.all(grid.centres_m(near)[:, 1] < 1.2), "this test wants the dead end alone near by"
    reach = reach_from(grid, here)
    assert reach.escaping
    room_cell = int(grid.cells_of(np.array([[1.5, 3.0]]))[0][0])
    path = path_from_robot(grid, reach, room_cell)
    assert grid.path_clearance_m(path).min() >= 0.22 - CORNER_M
    assert np.all(grid.path_clearance_m(path)[1:] >= grid.radius_m - 1e-6)
