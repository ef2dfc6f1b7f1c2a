"""Orders of visit by gain and time of arrival."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hgs_core.errors import PlanningError
from hgs_core.planning.latency import least_latency_order


def on_a_line(*places_m: float) -> np.ndarray:
    """Costs between places on a line, the first of them the start."""
    at = np.array(places_m)
    return np.abs(at[:, None] - at[None, :])


def objective(costs: np.ndarray, gains: np.ndarray, order: tuple[int, ...], urgency: float) -> float:
    """By hand, step by step."""
    at, arrival, total = 0, 0.0, 0.0
    for place in order:
        arrival += costs[at, place]
        total += gains[place - 1] * arrival
        at = place
    return urgency * total / gains.sum() + (1.0 - urgency) * arrival


def test_much_gain_comes_first_although_little_is_nearer() -> None:
    """Gain 1 at 1 m left, 10 at 2 m right: left first costs 1 * 1 + 10 * 4, right first 10 * 2 + 1 * 5."""
    costs = on_a_line(0.0, -1.0, 2.0)
    assert least_latency_order(costs, np.array([1.0, 10.0]), urgency=1.0).tolist() == [2, 1]


def test_little_on_the_way_is_taken_along() -> None:
    costs = on_a_line(0.0, 5.0, 2.0)
    assert least_latency_order(costs, np.array([10.0, 0.1]), urgency=1.0).tolist() == [2, 1]


def test_the_less_urgent_the_more_the_whole_way_counts() -> None:
    """As before, but left first is the shorter way, 4 m instead of 5. Mean arrivals are 41 / 11 and 25 / 11:
    left first is better when 41 u / 11 + 4 (1 - u) < 25 u / 11 + 5 (1 - u), which is u < 11 / 27."""
    costs, gains = on_a_line(0.0, -1.0, 2.0), np.array([1.0, 10.0])
    assert least_latency_order(costs, gains, urgency=0.42).tolist() == [2, 1]
    assert least_latency_order(costs, gains, urgency=0.39).tolist() == [1, 2]


@pytest.mark.parametrize("urgency", [0.1, 0.5, 1.0])
def test_small_problems_are_solved_nearly_or_quite_best(urgency: float) -> None:
    """Against every order of six places, asymmetric costs."""
    rng = np.random.default_rng(0)
    excess = []
    for _ in range(20):
        places = rng.uniform(0, 10, (7, 2))
        costs = np.linalg.norm(places[:, None] - places[None], axis=2) + rng.uniform(0, 2, (7, 7))
        gains = rng.exponential(2.0, 6)
        found = objective(costs, gains, tuple(least_latency_order(costs, gains, urgency=urgency)), urgency)
        best = min(objective(costs, gains, order, urgency) for order in itertools.permutations(range(1, 7)))
        excess.append(found / best - 1.0)
    assert np.mean(np.array(excess) < 1e-9) >= 0.7
    assert max(excess) < 0.1


def test_every_place_once() -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(0, 30, (31, 2))
    costs = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert sorted(least_latency_order(costs, rng.random(30), urgency=0.5)) == list(range(1, 31))
    assert least_latency_order(np.zeros((1, 1)), np.zeros(0), urgency=1.0).tolist() == []


def test_what_cannot_be_reached_is_refused() -> None:
    costs = on_a_line(0.0, 1.0)
    costs[0, 1] = np.inf
    with pytest.raises(PlanningError, match="cannot be reached"):
        least_latency_order(costs, np.array([1.0]), urgency=0.5)
