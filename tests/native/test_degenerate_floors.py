"""The kernels of floors and ways at the edge of what they take: empty and one-cell grids, places in walls, on
the border and far off, numbers that are none. With `make sanitize` every access and every
conversion is checked, too.

Whatever comes in, a kernel either refuses it (`ValueError`) or answers by its laws.
"""

import numpy as np
import pytest

from hgs_core.native import kernels

NOWHERE = np.zeros((0, 3))
SHAPES = [(0, 0), (0, 4), (3, 0), (1, 1), (1, 9), (8, 1), (2, 2), (12, 10), (23, 17)]
BODIES = [[1.0, 3.8, 2.0], [0.0, 0.4, 0.3], [30.0, 40.0, 25.0], [20.0, 20.0, 1e-9], [1e-9, 1e-9, 9.0]]
RADII = [1e-3, 0.7, 4.0, 250.0, 1e9]
BEYOND = [1e10, 1e12, -1e12, 1e300, -1e300, 1.7e308]


class Floor:
    """A random floor plan; `share` of it is blocked."""

    def __init__(self, rng: np.random.Generator, shape: tuple[int, int], share: float) -> None:
        self.shape = shape
        self.blocked = (rng.random(shape) < share).astype(np.uint8)
        self.clearance = kernels.grid_box_clearance(self.blocked, 8.0)
        self.soft_cost = rng.uniform(1.0, 4.0, shape).astype(np.float32)
        self.cost = self.soft_cost.copy()
        self.cost[self.blocked > 0] = rng.choice([np.inf, np.nan, 0.0, -1.0])

    def cell_of(self, pose: np.ndarray) -> tuple[int, int] | None:
        inside = (pose[:2] >= 0) & (pose[:2] < self.shape)
        return (int(pose[0]), int(pose[1])) if inside.all() else None

    def reaches_over(self, pose: np.ndarray, body: list[float]) -> bool:
        """Whether a corner of the rectangle lies clearly outside the grid."""
        rear, front, half = body
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        ahead, aside = np.array([front, front, -rear, -rear]), np.array([half, -half, half, -half])
        corners = pose[:2] + np.stack([ahead * cos - aside * sin, ahead * sin + aside * cos], axis=1)
        return bool(np.any((corners < -1e-6) | (corners > np.array(self.shape) + 1e-6)))


def wild_poses(rng: np.random.Generator, shape: tuple[int, int], n: int) -> np.ndarray:
    """Anywhere on a floor and around it, on its border, next to it, and very far from it."""
    size = np.array(shape, float)
    places = rng.uniform(-2.0, size + 2.0, (n, 2))
    yaws = rng.choice([0.0, np.pi / 2, np.pi, -np.pi, 1e-17, 0.3, 40.0, -1e9, 1e17], n) + rng.normal(
        0, 0.1, n
    )
    for place in places:
        axis = rng.integers(2)
        match rng.integers(6):
            case 0:
                place[axis] = rng.choice([0.0, -0.0, size[axis], np.nextafter(size[axis], 0), 5e-324])
            case 1:
                place[:] = np.floor(place)
            case 2 if rng.random() < 0.3:
                place[axis] = rng.choice(BEYOND)
    return np.column_stack([places, yaws])


def floors(seed: int) -> list[tuple[np.random.Generator, Floor]]:
    rng = np.random.default_rng(seed)
    return [(rng, Floor(rng, shape, share)) for shape in SHAPES for share in (0.0, 0.15, 1.0)]


@pytest.mark.parametrize("seed", range(3))
def test_a_rectangle_that_fits_lies_inside_and_on_nothing(seed):
    for rng, floor in floors(seed):
        poses = wild_poses(rng, floor.shape, 60)
        for body in BODIES:
            free = kernels.car_poses_free(floor.blocked, floor.clearance, np.array(body), poses, NOWHERE)
            for pose in poses[free]:
                assert not floor.reaches_over(pose, body)
                cell = floor.cell_of(pose)
                if cell is not None:  # rounding may leave the reference point on the border
                    assert not floor.blocked[cell] or min(np.mod(pose[:2], 1.0)) < 1e-6 or min(body) < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_where_a_car_stands_is_forgiven_but_nothing_far_beyond_the_border(seed):
    for rng, floor in floors(seed):
        for standing in wild_poses(rng, floor.shape, 6):
            for body in BODIES[:3]:
                far = standing + np.outer([1.0, -1.0], [300.0, 300.0, 0.0])
                poses = np.concatenate([standing[None], far])
                free = kernels.car_poses_free(
                    floor.blocked, floor.clearance, np.array(body), poses, standing[None]
                )
                if np.abs(standing[:2]).max() < 100.0:
                    assert free.tolist() == [True, False, False]


@pytest.mark.parametrize("seed", range(4))
def test_ways_of_a_car(seed):
    n_found = 0
    for rng, floor in floors(seed):
        poses = wild_poses(rng, floor.shape, 12)
        if floor.cost.size:
            poses[:8, :2] = rng.uniform(0.0, floor.shape, (8, 2))
        for k in range(12):
            start, goals = poses[k], poses[[rng.integers(8)] * 2] + [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
            body, radius = BODIES[rng.integers(len(BODIES))], RADII[rng.integers(len(RADII))]
            most, weight = int(rng.choice([-1, 0, 1, 300])), float(rng.choice([0.0, 1.3, 50.0]))
            costs = np.array([rng.choice([1.0, 2.0]), rng.choice([0.0, 5.0]), rng.choice([0.0, 1.0])])
            way, total, expanded = kernels.hybrid_astar(
                floor.blocked,
                floor.clearance,
                floor.soft_cost,
                floor.cost,
                np.array(body),
                radius,
                costs,
                start[None],
                goals,
                weight,
                most,
                0.5,
            )
            assert expanded <= max(most, 0)
            assert (len(way) > 0) == np.isfinite(total)
            if len(way) == 0:
                continue
            n_found += 1
            assert total >= 0.0
            assert np.isfinite(way).all()
            np.testing.assert_array_equal(way[0, :2], start[:2])
            assert np.exp(1j * way[0, 2]) == pytest.approx(np.exp(1j * start[2]), abs=1e-9)
            # An arc of a huge circle is as exact as its angle, times the radius; of a tiny one, arcs shorter
            # than a millionth of a cell are left out.
            np.testing.assert_allclose(way[-1, :2], goals[0, :2], atol=1e-6 + 1e-12 * radius + 1e-4 / radius)
    assert n_found > 0


@pytest.mark.parametrize("seed", range(3))
def test_everywhere_that_a_car_can_get_to(seed):
    for rng, floor in floors(seed):
        for start in wild_poses(rng, floor.shape, 3):
            body, radius = BODIES[rng.integers(len(BODIES))], RADII[rng.integers(len(RADII))]
            n_headings = int(rng.choice([1, 2, 24]))
            costs = np.array([2.0, rng.choice([0.0, 5.0, 1e5]), 1.0])
            reach = kernels.car_reach(
                floor.blocked, floor.clearance, np.array(body), radius, costs, start[None], n_headings
            )
            assert reach.shape == (*floor.shape, n_headings)
            assert not np.isnan(reach).any()
            cell = floor.cell_of(start)
            assert np.isfinite(reach).any() == (cell is not None)
            if cell is not None:
                assert reach[cell].min() == 0.0


def test_reeds_shepp_between_places_far_apart_and_on_top_of_each_other():
    rng = np.random.default_rng(0)
    poses = np.concatenate([wild_poses(rng, (5, 5), 40), np.zeros((2, 3)), [[4.0 - 4e-16, 1.0, 0.5]]])
    for radius in (*RADII, 1e300):
        lengths = kernels.reeds_shepp_lengths(poses, poses, radius)
        assert not np.isnan(lengths).any()
        assert (np.diag(lengths) <= 1e-6 * radius).all()
    for pose in poses:
        words = kernels.reeds_shepp_words(pose)
        assert words.shape[1:] == (5, 2)
        assert set(np.unique(words[:, :, 0])) <= {-1.0, 0.0, 1.0}
    assert kernels.reeds_shepp_lengths(NOWHERE, poses, 1.0).shape == (0, len(poses))


def test_a_goal_just_within_the_table_of_lengths():
    """Its column lies at the table's end by rounding: 4 - 2^-51 and 4 add up to 8."""
    floor = Floor(np.random.default_rng(0), (12, 12), 0.0)
    goal = np.array([[4.0 + (4.0 - 2.0**-51), 11.0, 0.0]])
    start = np.array([[4.0, 11.0 - (4.0 - 2.0**-51), 0.0]])
    for a, b in ((start, goal), (goal, start)):
        kernels.hybrid_astar(
            floor.blocked,
            floor.clearance,
            floor.soft_cost,
            floor.cost,
            np.array([0.1, 0.1, 0.1]),
            1.0,
            np.ones(3),
            a,
            b,
            1.0,
            50,
            0.5,
        )


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", range(3))
def test_what_is_no_number_is_no_pose_no_body_and_no_cost(wrong, axis):
    floor = Floor(np.random.default_rng(0), (6, 6), 0.0)
    pose, body, costs = np.array([[3.0, 3.0, 0.0]]), np.array([0.5, 0.5, 0.4]), np.array([2.0, 1.0, 1.0])
    plan = (floor.blocked, floor.clearance)
    no_pose, no_body, no_costs = pose.copy(), body.copy(), costs.copy()
    no_pose[0, axis] = no_body[axis] = no_costs[axis] = wrong
    with pytest.raises(ValueError, match="pose"):
        kernels.car_reach(*plan, body, 1.0, costs, no_pose, 8)
    with pytest.raises(ValueError, match="body"):
        kernels.car_reach(*plan, no_body, 1.0, costs, pose, 8)
    with pytest.raises(ValueError, match="costs"):
        kernels.car_reach(*plan, body, 1.0, no_costs, pose, 8)
    for radius in (wrong, 0.0, 1e300):
        with pytest.raises(ValueError, match="radius"):
            kernels.car_reach(*plan, body, radius, costs, pose, 8)
    with pytest.raises(ValueError, match="pose"):
        kernels.car_poses_free(*plan, body, no_pose, NOWHERE)
    with pytest.raises(ValueError, match="pose"):
        kernels.reeds_shepp_words(no_pose[0])
    with pytest.raises(ValueError, match="pose"):
        kernels.reeds_shepp_lengths(pose, no_pose, 1.0)


@pytest.mark.parametrize("seed", range(3))
def test_flags_in_discs_anywhere(seed):
    for rng, floor in floors(seed):
        points = wild_poses(rng, floor.shape, 30)[:, :2].copy()
        points[-1] = rng.choice([np.nan, np.inf, -np.inf])
        for radius in (0.0, 1e-300, 3.0, 1e6, 1e300, np.inf, np.nan, -1.0):
            counts = kernels.grid_count_in_discs(floor.blocked, points, radius)
            assert ((counts >= 0) & (counts <= np.count_nonzero(floor.blocked))).all()


@pytest.mark.parametrize("seed", range(3))
def test_clearance_and_straight_lines_anywhere(seed):
    for rng, floor in floors(seed):
        for cap in (0.0, 2.5, 1e9, np.inf):
            clearance = kernels.grid_box_clearance(floor.blocked, cap)
            assert (clearance >= 0).all()
            assert (clearance[floor.blocked > 0] == 0).all()
        plan = (floor.blocked, floor.clearance, floor.soft_cost)
        points = np.clip(wild_poses(rng, floor.shape, 20)[:, :2], -1e4, 1e4)
        for n in (0, 1, 2, 20):
            kept = kernels.grid_straighten(*plan, points[:n].copy(), 0.5, 8.0, 1.0, 1.3)
            assert len(kept) >= min(n, 2)
            assert (np.diff(kept) > 0).all()
        segments = np.concatenate([points, points[::-1]], axis=1)
        least, cost = kernels.grid_segments(*plan, segments, 0.5, 8.0)
        assert ((least >= 0) & (least <= 8)).all()
        assert (cost >= 0).all()
        for bad in (np.nan, np.inf, 1e300):
            segments[0, 2] = bad
            with pytest.raises(ValueError, match="point"):
                kernels.grid_segments(*plan, segments, 0.5, 8.0)
        for step, cap in ((0.0, 8.0), (np.nan, 8.0), (0.5, np.nan), (0.5, -1.0)):
            with pytest.raises(ValueError, match="step"):
                kernels.grid_straighten(*plan, points, step, cap, 1.0, 1.3)


@pytest.mark.parametrize("seed", range(3))
def test_shortest_paths_on_floors_of_any_shape(seed):
    for rng, floor in floors(seed):
        n = min(floor.cost.size, 5)
        cells = rng.integers(0, max(floor.cost.size, 1), n).astype(np.int32)
        distance, parent = kernels.grid_dijkstra(floor.cost, cells, rng.choice([0.0, 2.0, 1e4, np.inf], n))
        assert not np.isnan(distance).any()
        assert ((parent >= 0) == np.isfinite(distance)).all()
        pairs = kernels.grid_pairwise(floor.cost, cells)
        costs, *_ = kernels.grid_ways(floor.cost, cells)
        np.testing.assert_array_equal(np.isfinite(pairs), np.isfinite(costs))
        for a in range(n):
            path, length = kernels.grid_astar(floor.cost, int(cells[0]), int(cells[a]))
            assert length == pytest.approx(pairs[0, a])
            assert (len(path) > 0) == np.isfinite(length)


def test_costs_that_no_queue_can_hold_are_refused():
    cost = np.array([[1e-30, 1.0], [1.0, 1e30]], np.float32)
    seed = np.zeros(1, np.int32)
    with pytest.raises(ValueError, match="differ too much"):
        kernels.grid_dijkstra(cost, seed, np.zeros(1))
    with pytest.raises(ValueError, match="differ too much"):
        kernels.grid_pairwise(cost, seed)
    for wrong in (np.nan, -1.0, 1e30):
        with pytest.raises(ValueError, match="seed"):
            kernels.grid_dijkstra(np.ones((2, 2), np.float32), seed, np.array([wrong]))


@pytest.mark.parametrize("greatest", [0.0, 1.0, 1e12, 1e99])
def test_tours_and_orders_of_any_cost(greatest):
    rng = np.random.default_rng(1)
    for n in (1, 2, 3, 9, 12, 13, 16):
        cost = rng.uniform(-0.1, 1.0, (n, n)) * greatest
        for end in {-1, -7, n - 1} - {0}:
            order, total = kernels.open_tour(cost, end)
            assert sorted(order) == list(range(n))
            assert np.isfinite(total)
        improved, _ = kernels.improve_latency(
            cost, rng.uniform(0, 1, n), 0.1, 5, np.arange(1, n, dtype=np.int32)
        )
        assert sorted(improved) == list(range(1, n))
    with pytest.raises(ValueError, match="finite"):
        kernels.open_tour(np.full((14, 14), 1e308), -1)


def test_darts_at_no_points_and_at_no_numbers():
    points = np.array([[0.0, 0.0], [np.nan, 1.0], [0.1, 0.0], [np.inf, -np.inf]])
    order = np.arange(4, dtype=np.int64)
    for limit in (0, 1, 4, 2**40):
        assert len(kernels.throw_darts(points, order, points[:1], 0.5, limit)) <= min(limit, 4)
    assert len(kernels.throw_darts(np.zeros((0, 2)), order[:0], points, 0.5, 3)) == 0
