"""A car's ways over the grid, against naive oracles: rectangles by their corners, reach by plain Dijkstra."""

import numpy as np
import pytest

from hgs_core.native import kernels
from hgs_core.planning.car_ways import CarWays, KinodynamicConfig, body_of, poses_free
from hgs_core.planning.navigation_grid import NavigationConfig, NavigationGrid, build_navigation_grid
from hgs_core.planning.path_search import reach_from_cells
from hgs_core.robot.ackermann import Ackermann, AckermannConfig, driven_arcs
from hgs_core.robot.path import Path
from tests.planning.floors import grid_of, room
from tests.planning.plain_car_search import plain_costs, state_of

CAR = AckermannConfig()
CONFIG = KinodynamicConfig()
BODY = body_of(CAR, CONFIG.margin_m)


def cluttered(seed: int) -> NavigationGrid:
    """A room of 5 x 4 m with boxes of up to half a metre."""
    rng = np.random.default_rng(seed)
    voxels = room(50, 40)
    for _ in range(8):
        i, j = rng.integers(5, 45), rng.integers(5, 35)
        voxels.states[i : i + rng.integers(1, 6), j : j + rng.integers(1, 6)] = 2
    voxels.note_change()
    return grid_of(voxels)


def meets(grid: NavigationGrid, pose: np.ndarray, body: np.ndarray = BODY) -> bool:
    """Whether a rectangle meets a blocked cell, by points a hundredth of a metre apart in it."""
    rear, front, half = body
    u, v = np.meshgrid(np.arange(-rear, front + 0.005, 0.01), np.arange(-half, half + 0.005, 0.01))
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    points = np.column_stack([(pose[0] + u * cos - v * sin).ravel(), (pose[1] + u * sin + v * cos).ravel()])
    cells, inside = grid.cells_of(points)
    return bool(np.any(~inside) or np.any(grid.blocked.ravel()[cells[inside]]))


def random_poses(grid: NavigationGrid, rng: np.random.Generator, n: int) -> np.ndarray:
    upper = np.array(grid.shape) * grid.size_m
    return np.column_stack([rng.uniform(grid.lower_m, upper, (n, 2)), rng.uniform(-np.pi, np.pi, n)])


def free_poses(grid: NavigationGrid, rng: np.random.Generator, n: int) -> np.ndarray:
    poses = random_poses(grid, rng, 60 * n)
    return poses[poses_free(grid, BODY, poses, standing=np.zeros((0, 3)))][:n]


@pytest.mark.parametrize("seed", range(3))
def test_where_the_rectangle_fits(seed):
    grid = cluttered(seed)
    poses = random_poses(grid, np.random.default_rng(seed), 250)
    free = poses_free(grid, BODY, poses, standing=np.zeros((0, 3)))
    assert not any(meets(grid, pose) for pose in poses[free])
    # Points a hundredth apart may miss a corner of a cell, but not if the rectangle is larger by as much.
    assert all(meets(grid, pose, BODY + 0.012) for pose in poses[~free])


def test_what_the_car_stands_in_is_forgiven_but_not_driven_into_deeper():
    voxels = room(40, 30)
    voxels.states[23:25, 10:20] = 2
    voxels.note_change()
    grid = grid_of(voxels)
    standing = np.array([[2.0, 1.5, 0.0]])  # its front reaches 10 cm into the box at 2.3 m
    poses = standing + np.array([[0.0, 0.0, 0.0], [-0.05, 0.0, 0.0], [0.05, 0.0, 0.0]])
    assert poses_free(grid, BODY, poses, standing=np.zeros((0, 3))).tolist() == [False, False, False]
    assert poses_free(grid, BODY, poses, standing=standing).tolist() == [True, True, False]


@pytest.mark.parametrize("standing", [[1.42727, 1.44573, 0.212204], [1.45, 1.45, 0.157]])
def test_a_car_gets_out_of_a_place_where_no_step_of_the_lattices_fits(standing):
    """As a robot once stood, between a wall and a chair: it could go, but only by a hand's breadth."""
    voxels = room(29, 29)
    voxels.states[:12] = 2
    for j, taken in enumerate(
        ("#####..###", "######.###", "######..###", "######..###", "######.###", "#####..###")
    ):
        first = 18 if len(taken) == 11 else 19
        for i, mark in enumerate(taken, first):
            voxels.states[i, 13 - j] = 2 if mark == "#" else voxels.states[i, 13 - j]
    voxels.note_change()
    grid, pose = grid_of(voxels), np.array(standing)
    assert poses_free(grid, BODY, pose[None], standing=np.zeros((0, 3)))[0]
    ways = CarWays(grid, CAR, CONFIG, pose)
    assert np.count_nonzero(ways.reach.anyhow) > 150
    goal = np.array([2.2, 2.2, np.pi])
    way = ways.way(pose, goal[:2], goal[2:])
    assert way is not None
    assert way.positions_m[-1] == pytest.approx(goal[:2], abs=1e-6)
    poses = np.column_stack([way.positions_m, way.headings_rad])
    assert poses_free(grid, BODY - CONFIG.margin_m, poses, standing=np.zeros((0, 3))).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_way_ends_where_it_should_keeps_its_curvature_and_meets_nothing(seed):
    grid = cluttered(seed)
    rng = np.random.default_rng(seed)
    starts, goals = free_poses(grid, rng, 3), free_poses(grid, rng, 3)
    for start, goal in zip(starts, goals, strict=True):
        ways = CarWays(grid, CAR, CONFIG, start)
        yaws = goal[2] + np.array([0.0, 0.3])
        path = ways.way(start, goal[:2], yaws)
        if path is None:
            cell = grid.cells_of(goal[None, :2])[0]
            assert not np.isfinite(ways.reach.costs_at(cell, goal[2:])).all()
            continue
        assert path.headings_rad is not None
        np.testing.assert_allclose(path.positions_m[0], start[:2], atol=1e-9)
        np.testing.assert_allclose(path.positions_m[-1], goal[:2], atol=1e-6)
        off = np.remainder(path.headings_rad[-1] - yaws + np.pi, 2 * np.pi) - np.pi
        assert np.min(np.abs(off)) < 1e-6
        _, lengths, curvatures = driven_arcs(path.positions_m, path.headings_rad)
        assert np.max(np.abs(curvatures)) <= 1.0 / CAR.planned_radius_m + 1e-6
        assert np.max(lengths) <= 0.05 + 1e-9
        poses = np.column_stack([path.positions_m, path.headings_rad])
        body = body_of(CAR, 0.0)
        assert not any(meets(grid, pose, body) for pose in poses)
        Ackermann(CAR).timed(path, start[2])  # and can be driven


def test_reach_against_plain_dijkstra():
    """The same steps without buckets: no state is dearer than half a step and a change of gear more."""
    voxels = room(18, 16)
    voxels.states[8:10, 6:9] = 2
    voxels.note_change()
    grid = grid_of(voxels)
    start = np.array([0.5, 0.8, 1.0])
    reach = CarWays(grid, CAR, CONFIG, start).reach.cost_m
    turns, n_headings = (0.0, 1.0, -1.0), reach.shape[2]
    oracle = plain_costs(grid, CAR, CONFIG, start, step_m=0.15, turns=turns, n_headings=n_headings, checks=2)
    np.testing.assert_array_less(-1.0, reach)
    both = np.isfinite(reach) & np.isfinite(oracle)
    assert np.count_nonzero(np.isfinite(reach) != np.isfinite(oracle)) <= 0.02 * np.count_nonzero(both)
    apart = reach[both] - oracle[both]
    assert np.quantile(np.abs(apart), 0.95) <= 0.3
    assert np.abs(np.median(apart)) <= 0.1


def test_open_floor_gives_the_shortest_way_and_a_straight_is_straight():
    grid = grid_of(room(80, 60))
    start = np.array([2.0, 3.0, 0.0])
    ways = CarWays(grid, CAR, CONFIG, start)
    path = ways.way(start, np.array([5.0, 3.0]), np.array([0.0]))
    assert path is not None
    assert path.length_m == pytest.approx(3.0, abs=1e-6)
    np.testing.assert_allclose(path.positions_m[:, 1], 3.0, atol=1e-9)
    goal = np.array([4.0, 4.0, 1.2])
    there = ways.way(start, goal[:2], goal[2:])
    assert there is not None
    shortest = kernels.reeds_shepp_lengths(start[None], goal[None], CAR.planned_radius_m)[0, 0]
    assert there.length_m <= 1.1 * shortest


def test_a_dead_end_is_left_backwards():
    voxels = room(60, 30)
    voxels.states[30:59, 1:12] = 2
    voxels.states[30:59, 18:29] = 2  # a corridor of 0.6 m to the right: no room to turn
    voxels.note_change()
    grid = grid_of(voxels)
    start = np.array([5.0, 1.5, 0.0])
    path = CarWays(grid, CAR, CONFIG, start).way(start, np.array([1.0, 1.5]), np.array([np.pi]))
    assert path is not None
    assert path.headings_rad is not None
    gears, lengths, _ = driven_arcs(path.positions_m, path.headings_rad)
    assert lengths[gears < 0].sum() > 1.5
    assert np.count_nonzero(np.diff(gears)) <= 2


def test_a_car_that_backed_up_to_a_wall_still_reaches_the_room():
    voxels = room(50, 40)
    voxels.states[5:7, 10:30] = 2  # beside it a pocket that a disc could not leave
    voxels.note_change()
    grid = grid_of(voxels)
    start = np.array([0.84, 2.0, 0.0])  # its rear 4 cm from the boxes: closer than a disc could stand
    ways = CarWays(grid, CAR, CONFIG, start)
    reach = reach_from_cells(grid, start[:2], *ways.entries())
    assert reach.escaping
    corner = int(grid.cells_of(np.array([[4.2, 3.2]]))[0][0])
    assert np.isfinite(reach.distance_m.ravel()[corner])
    assert ways.reach.anyhow.ravel()[corner]


def test_a_car_that_stands_too_near_to_a_wall_drives_off_along_it():
    grid = grid_of(room(50, 30))
    start = np.array([1.0, 0.29, 0.0])  # a centimetre between its side and the wall: less than the margin
    ways = CarWays(grid, CAR, CONFIG, start)
    assert not ways.poses_free(start[None])[0]
    path = ways.way(start, np.array([3.0, 1.5]), np.array([0.0]))
    assert path is not None
    assert path.headings_rad is not None
    poses = np.column_stack([path.positions_m, path.headings_rad])
    assert poses_free(grid, body_of(CAR, -0.015), poses, standing=np.zeros((0, 3))).all()


@pytest.mark.parametrize("seed", range(3))
def test_ways_against_a_plain_search_of_the_lattice(seed):
    """Dijkstra with the same steps, no words, no estimate of what is left. To come to a pose exactly costs it
    shuffling back and forth, which words spare; to come to about there cannot cost it more than a way."""
    rng, n_headings = np.random.default_rng(seed), 72
    voxels = room(26, 22)
    for _ in range(2):
        i, j = rng.integers(7, 19), rng.integers(6, 16)
        voxels.states[i : i + 3, j : j + 4] = 2
    voxels.note_change()
    even = NavigationConfig(clearance_weight=0.0, unobserved_weight=0.0)
    grid = build_navigation_grid(voxels, even, CAR, robot_xy_m=None)
    start, *goals = free_poses(grid, rng, 6)
    turns = (0.0, 1.0, -1.0, 0.5, -0.5)
    plain = plain_costs(grid, CAR, CONFIG, start, step_m=0.18, turns=turns, n_headings=n_headings, checks=4)
    ways = CarWays(grid, CAR, KinodynamicConfig(heuristic_weight=1.0), start)
    for goal in goals:
        i, j, h = state_of(grid, goal, n_headings)
        exactly = plain[i, j, h]
        about = min(
            plain[i + di, j + dj, (h + dh) % n_headings]
            for di in (-1, 0, 1)
            for dj in (-1, 0, 1)
            for dh in (-2, -1, 0, 1, 2)
        )
        path = ways.way(start, goal[:2], goal[2:])
        assert (path is not None) == np.isfinite(exactly)
        if path is not None:
            # From the goal's cell to its middle it may have to change gear once more.
            assert about - 0.3 <= _cost(path) <= exactly + CONFIG.gear_change_m + 0.3, goal


def _cost(path: Path) -> float:
    """As the settings define it: metres, metres backwards, changes of gear and of the wheels."""
    gears, lengths, curvatures = driven_arcs(path.positions_m, path.headings_rad)
    driven = float(np.sum(lengths * np.where(gears < 0, CONFIG.reverse_factor, 1.0)))
    changes = CONFIG.gear_change_m * np.count_nonzero(np.diff(gears))
    turns = curvatures * CAR.planned_radius_m
    return driven + changes + 0.5 * CONFIG.steering_change_m * float(np.sum(np.abs(np.diff(turns))))
