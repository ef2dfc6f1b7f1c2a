"""Covering paths against the exact optimum of small instances."""

import heapq
from itertools import combinations

import numpy as np
import pytest
from scipy.sparse import csr_array

from hgs_core.errors import SceneError
from hgs_core.evaluation.covering_path import CoverProblem, covering_path, packed
from hgs_core.evaluation.floor_graph import FloorGraph


def graph_of(positions: np.ndarray, hops: list[tuple[int, int]]) -> FloorGraph:
    lengths = np.zeros((len(positions), len(positions)))
    for a, b in hops:
        lengths[a, b] = lengths[b, a] = np.linalg.norm(positions[a] - positions[b])
    return FloorGraph(positions_m=positions, hops_m=csr_array(lengths))


def shortest(graph: FloorGraph, seen: np.ndarray, start: int, n_wanted: int) -> float:
    """Dijkstra's search over (place, what was seen so far): exact, and exponential in the samples."""
    sets = [sum(1 << i for i in np.flatnonzero(row)) for row in seen]
    hops = graph.hops_m.toarray()
    best = {(start, sets[start]): 0.0}
    queue = [(0.0, start, sets[start])]
    while queue:
        length, place, so_far = heapq.heappop(queue)
        if so_far.bit_count() >= n_wanted:
            return length
        if length > best[place, so_far]:
            continue
        for other in np.flatnonzero(hops[place]):
            state = (int(other), so_far | sets[other])
            ahead = length + hops[place, other]
            if ahead < best.get(state, np.inf):
                best[state] = ahead
                heapq.heappush(queue, (ahead, *state))
    raise AssertionError("cannot be seen")


@pytest.mark.parametrize("seed", range(12))
def test_near_the_optimum_of_random_grids(seed: int) -> None:
    """5 x 4 places with some hops missing, 12 samples seen from one to three places each."""
    rng = np.random.default_rng(seed)
    positions = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij"), -1).reshape(-1, 2)
    near = [
        (a, b) for a, b in combinations(range(20), 2) if np.linalg.norm(positions[a] - positions[b]) < 1.5
    ]
    kept = [hop for hop in near if hop[1] - hop[0] == 4 or rng.random() < 0.7]
    kept += [(4 * i, 4 * i + 1) for i in range(5)] + [(i, i + 1) for i in range(3)]
    graph = graph_of(positions, kept)
    seen = np.zeros((20, 12), dtype=bool)
    for sample in range(12):
        seen[rng.choice(20, rng.integers(1, 4), replace=False), sample] = True
    problem = CoverProblem(graph, packed(seen), 0)
    for n_wanted in (8, 10, 12):
        exact = shortest(graph, seen, 0, n_wanted)
        path = covering_path(problem, n_wanted, rng=np.random.default_rng(0), rounds=150)
        assert path.n_seen >= n_wanted
        assert path.stops[0] == 0
        assert exact - 1e-9 <= path.length_m <= 1.05 * exact + 1e-9


def star() -> CoverProblem:
    """Arms of 1, 2 and 3 m from the start; ten samples at the end of each, one half way up the longest."""
    positions = np.array([[0, 0], [1, 0], [0, 2], [-1.5, 0], [-3, 0]], float)
    seen = np.zeros((5, 31), dtype=bool)
    seen[1, :10], seen[2, 10:20], seen[4, 20:30], seen[3, 30] = True, True, True, True
    return CoverProblem(graph_of(positions, [(0, 1), (0, 2), (0, 3), (3, 4)]), packed(seen), 0)


@pytest.mark.parametrize(
    ("n_wanted", "length_m"), [(10, 1.0), (20, 1 + 1 + 2), (30, 2 * 1 + 2 * 2 + 3), (31, 2 * 1 + 2 * 2 + 3)]
)
def test_a_star_by_hand(n_wanted: int, length_m: float) -> None:
    """The longest arm comes last, for one need not come back; what it passes half way counts."""
    path = covering_path(star(), n_wanted, rng=np.random.default_rng(0), rounds=20)
    assert path.length_m == pytest.approx(length_m)


def test_equal_generators_give_equal_paths() -> None:
    rng = np.random.default_rng(5)
    positions = rng.uniform(0, 10, (60, 2))
    hops = [(a, b) for a, b in combinations(range(60), 2) if np.hypot(*(positions[a] - positions[b])) < 3.5]
    problem = CoverProblem(graph_of(positions, hops), packed(rng.random((60, 300)) < 0.05), 0)
    first, second = (covering_path(problem, 250, rng=np.random.default_rng(1), rounds=10) for _ in range(2))
    assert first == second


def test_a_search_never_loses_what_it_began_with() -> None:
    problem = star()
    best = covering_path(problem, 31, rng=np.random.default_rng(0), rounds=20)
    again = covering_path(problem, 20, rng=np.random.default_rng(0), rounds=0, begin_with=[best.stops])
    assert again.length_m <= best.length_m


def test_more_than_can_be_seen_is_refused() -> None:
    with pytest.raises(SceneError, match="see 31 samples of the 32 wanted"):
        covering_path(star(), 32, rng=np.random.default_rng(0), rounds=1)
