import heapq
from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hgs_core.errors import PlanningError
from hgs_core.native import kernels
from hgs_core.planning.path_search import GridWays
from hgs_core.planning.tours import open_tour

costs = arrays(
    np.float32,
    st.tuples(st.integers(1, 9), st.integers(1, 9)),
    elements=st.sampled_from([1.0, 1.0, 1.5, 4.0, np.inf]),
)


def naive_distances(cost: np.ndarray, start: tuple[int, int]) -> np.ndarray:
    """Dijkstra with a dictionary: the oracle."""
    distance = {start: 0.0} if np.isfinite(cost[start]) else {}
    queue = [(0.0, start)] if distance else []

    def passable(i: int, j: int) -> bool:
        return 0 <= i < cost.shape[0] and 0 <= j < cost.shape[1] and bool(np.isfinite(cost[i, j]))

    while queue:
        d, (i, j) = heapq.heappop(queue)
        if d > distance[i, j]:
            continue
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                if (di, dj) == (0, 0) or not passable(i + di, j + dj):
                    continue
                if di and dj and not (passable(i + di, j) and passable(i, j + dj)):
                    continue
                to = (i + di, j + dj)
                through = d + np.hypot(di, dj) * 0.5 * (float(cost[i, j]) + float(cost[to]))
                if through < distance.get(to, np.inf):
                    distance[to] = through
                    heapq.heappush(queue, (through, to))
    result = np.full(cost.shape, np.inf)
    for cell, d in distance.items():
        result[cell] = d
    return result


@given(cost=costs, pick=st.tuples(st.integers(0, 80), st.integers(0, 80)))
def test_dijkstra_and_astar_equal_the_oracle(cost: np.ndarray, pick: tuple[int, int]) -> None:
    start, goal = pick[0] % cost.size, pick[1] % cost.size
    expected = naive_distances(cost, (start // cost.shape[1], start % cost.shape[1]))
    distance, parent = kernels.grid_dijkstra(cost, np.array([start], np.int32), np.zeros(1))
    np.testing.assert_allclose(distance, expected)
    assert np.array_equal(parent >= 0, np.isfinite(expected))
    cells, length = kernels.grid_astar(cost, start, goal)
    assert length == pytest.approx(expected.ravel()[goal])
    assert (len(cells) > 0) == np.isfinite(length)
    if len(cells):
        assert cells[0] == start
        assert cells[-1] == goal
        steps = np.abs(np.diff(np.stack([cells // cost.shape[1], cells % cost.shape[1]]), axis=1))
        assert np.all(steps.max(axis=0, initial=0) <= 1)


@given(cost=costs, seed=st.integers(0, 1000))
def test_pairwise_costs_are_those_of_single_searches(cost: np.ndarray, seed: int) -> None:
    cells = np.random.default_rng(seed).integers(0, cost.size, 4).astype(np.int32)
    between = kernels.grid_pairwise(cost, cells)
    for a, cell in enumerate(cells):
        single, _ = kernels.grid_dijkstra(cost, np.array([cell], np.int32), np.zeros(1))
        np.testing.assert_allclose(between[a], single.ravel()[cells])


def path_cost(cost: np.ndarray, cells: np.ndarray) -> float:
    """Of a path of neighbouring cells; refuses what is no path."""
    places = np.stack(np.unravel_index(cells, cost.shape), axis=1)
    total = 0.0
    for a, b in pairwise(places):
        assert max(abs(b - a)) == 1
        assert np.isfinite(cost[a[0], b[1]])
        assert np.isfinite(cost[b[0], a[1]])
        total += float(np.hypot(*(b - a))) * 0.5 * (float(cost[tuple(a)]) + float(cost[tuple(b)]))
    return total


@given(seed=st.integers(0, 10**6), n=st.integers(1, 9), walls=st.floats(0.0, 0.5))
def test_ways_between_all_cells_are_drivable_and_exact_to_the_nearest(
    seed: int, n: int, walls: float
) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.uniform(1.0, 5.0, (14, 11)).astype(np.float32)
    cost[rng.random(cost.shape) < walls] = np.inf
    cells = rng.integers(0, cost.size, n).astype(np.int32)
    exact = kernels.grid_pairwise(cost, cells)
    costs, after, crossings, parent = kernels.grid_ways(cost, cells)
    ways = GridWays(costs_m=costs, _next=after, _crossings=crossings, _parent=parent)
    np.testing.assert_array_equal(np.isfinite(costs), np.isfinite(exact))
    finite = np.isfinite(exact)
    assert (costs[finite] >= exact[finite] - 1e-9).all()
    for a in range(n):
        others = [b for b in range(n) if finite[a, b] and cells[b] != cells[a]]
        if others:
            nearest = min(others, key=lambda b: exact[a, b])
            assert costs[a, nearest] == pytest.approx(exact[a, nearest])
        for b in others:
            path = ways.cells_between(a, b)
            assert (path[0], path[-1]) == (cells[a], cells[b])
            distinct = path[np.concatenate([[True], np.diff(path) != 0])]
            assert path_cost(cost, distinct) == pytest.approx(costs[a, b])


@given(seed=st.integers(0, 10**6), radius=st.floats(0.0, 9.0))
def test_flags_in_discs_are_counted(seed: int, radius: float) -> None:
    rng = np.random.default_rng(seed)
    flags = rng.random((13, 17)) < 0.5
    points = rng.uniform(-4, 20, (6, 2))
    centres = np.argwhere(flags) + 0.5
    away = np.linalg.norm(centres[None] - points[:, None], axis=2)
    counts = kernels.grid_count_in_discs(flags.view(np.uint8), points, radius)
    np.testing.assert_array_equal(counts, (away <= radius).sum(axis=1))


def test_no_corner_is_cut() -> None:
    cost = np.ones((2, 2), np.float32)
    cost[0, 1] = np.inf
    distance, _ = kernels.grid_dijkstra(cost, np.array([0], np.int32), np.zeros(1))
    assert distance[1, 1] == pytest.approx(2.0)  # round the corner, not sqrt(2)


def test_seeds_keep_their_own_costs() -> None:
    cost = np.ones((1, 5), np.float32)
    distance, parent = kernels.grid_dijkstra(cost, np.array([0, 4], np.int32), np.array([0.0, 1.5]))
    np.testing.assert_allclose(distance, [[0.0, 1.0, 2.0, 2.5, 1.5]])
    assert parent.tolist() == [[0, 0, 1, 4, 4]]


def test_a_cell_outside_the_grid_is_refused() -> None:
    with pytest.raises(IndexError):
        kernels.grid_astar(np.ones((2, 2), np.float32), 0, 4)


def brute_force(matrix: np.ndarray, fixed_end: int | None) -> float:
    free = [k for k in range(1, len(matrix)) if k != fixed_end]
    tail = [] if fixed_end is None else [fixed_end]
    tours = ([0, *order, *tail] for order in permutations(free))
    return min(sum(matrix[a, b] for a, b in pairwise(t)) for t in tours)


def tour_cost(matrix: np.ndarray, order: np.ndarray) -> float:
    return float(matrix[order[:-1], order[1:]].sum())


@given(n=st.integers(1, 7), seed=st.integers(0, 10_000), ends=st.booleans())
def test_small_tours_are_optimal(n: int, seed: int, ends: bool) -> None:
    matrix = np.random.default_rng(seed).random((n, n))  # asymmetric
    fixed_end = n - 1 if ends and n > 1 else None
    order = open_tour(matrix, fixed_end=fixed_end)
    assert sorted(order.tolist()) == list(range(n))
    assert order[0] == 0
    assert fixed_end is None or order[-1] == fixed_end
    assert tour_cost(matrix, order) == pytest.approx(brute_force(matrix, fixed_end))


@pytest.mark.parametrize("n", [14, 25, 40])
def test_large_tours_are_near_those_of_or_tools(n: int) -> None:
    routing = pytest.importorskip("ortools.constraint_solver.pywrapcp")
    enums = pytest.importorskip("ortools.constraint_solver.routing_enums_pb2")
    places = np.random.default_rng(n).random((n, 2)) * 10
    matrix = np.linalg.norm(places[:, None] - places[None], axis=2)
    closed = np.zeros((n + 1, n + 1), np.int64)  # a dummy node at no cost opens the tour
    closed[:n, :n] = np.round(matrix * 1e4)
    nodes = routing.RoutingIndexManager(n + 1, 1, [0], [n])
    model = routing.RoutingModel(nodes)
    index = model.RegisterTransitCallback(
        lambda a, b: int(closed[nodes.IndexToNode(a), nodes.IndexToNode(b)])
    )
    model.SetArcCostEvaluatorOfAllVehicles(index)
    parameters = routing.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = enums.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    reference = model.SolveWithParameters(parameters).ObjectiveValue() / 1e4
    order = open_tour(matrix)
    assert sorted(order.tolist()) == list(range(n))
    assert tour_cost(matrix, order) <= 1.03 * reference + 1e-3
    assert np.array_equal(order, open_tour(matrix))


def test_unreachable_places_are_refused() -> None:
    matrix = np.zeros((3, 3))
    matrix[0, 2] = np.inf
    with pytest.raises(PlanningError, match="finite"):
        open_tour(matrix)
    with pytest.raises(PlanningError, match="cannot end"):
        open_tour(np.zeros((3, 3)), fixed_end=3)
