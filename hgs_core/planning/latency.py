"""In which order to take views when what is gained early counts more: least latency, weighed by gain.

A shortest tour visits everything with the least driving, whatever it gains when. The area above the curve of
what has been gained over time is the sum of `gain * time of arrival`: an order that makes it small (the
weighted travelling repairman problem) takes first what shows much unless it is far, but drives to and fro
when nothing stands out, and leaves what is small for long ways back. A weighted sum of both has neither
fault.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.errors import PlanningError

_MAX_SWEEPS = 60
"""Improvements of one start: each takes the best of all moves, so that few are needed."""


def least_latency_order(
    costs: Float[ndarray, "n_all n_all"], gains: Float[ndarray, " n"], *, urgency: float
) -> Int[ndarray, " n"]:
    """Places 1..n, from place 0, in the order that makes `urgency * A + (1 - urgency) * L` small.

    `A` is the mean time of arrival, weighed by gain, `L` the time of the last arrival. `costs[a, b]` is the
    time from place `a` to place `b`, finite, and may be asymmetric; `gains[k]`, not negative, belongs to
    place `k + 1`. Local search (one place moved elsewhere, or a stretch reversed; the best of all moves each
    time) from two starts: nearest first, and most gain for the time first. Deterministic. Raises
    `PlanningError` for a cost that is not finite.
    """
    n = len(gains)
    if costs.shape != (n + 1, n + 1) or not np.all(np.isfinite(costs)):
        raise PlanningError(
            f"{n} gains need finite costs of shape {(n + 1, n + 1)}, got {costs.shape}: "
            "leave out what cannot be reached"
        )
    if n < 2:
        return np.arange(1, n + 1)
    weights = np.concatenate([[0.0], gains]) * urgency / max(float(gains.sum()), 1e-9)
    whole_way = 1.0 - urgency
    starts = [_greedy(costs, np.ones(n + 1)), _greedy(costs, weights)]
    improved = [_improved(costs, weights, start, whole_way) for start in starts]
    return min(improved, key=lambda order: _latencies(costs, weights, order[None], whole_way)[0])


def _greedy(costs: Float[ndarray, "m m"], weights: Float[ndarray, " m"]) -> Int[ndarray, " n"]:
    """Always on to the place with the most weight for the time."""
    order, left, at = [], list(range(1, len(weights))), 0
    while left:
        at = max(left, key=lambda place: weights[place] / max(costs[at, place], 1e-3))
        left.remove(at)
        order.append(at)
    return np.array(order)


def _improved(
    costs: Float[ndarray, "m m"], weights: Float[ndarray, " m"], order: Int[ndarray, " n"], whole_way: float
) -> Int[ndarray, " n"]:
    moves = _moves(len(order))
    best = _latencies(costs, weights, order[None], whole_way)[0]
    for _ in range(_MAX_SWEEPS):
        tried = order[moves]
        latencies = _latencies(costs, weights, tried, whole_way)
        k = int(np.argmin(latencies))
        if latencies[k] >= best * (1.0 - 1e-9):
            break
        order, best = tried[k], latencies[k]
    return order


@lru_cache(maxsize=64)
def _moves(n: int) -> Int[ndarray, "n_moves n"]:
    """Every reversal of a stretch and every move of one place, as permutations."""
    moves = []
    for a in range(n):
        for b in range(n):
            if a == b:
                continue
            rest = [k for k in range(n) if k != a]
            moves.append([*rest[:b], a, *rest[b:]])
            if b > a + 1:
                moves.append([*range(a), *range(b, a - 1, -1), *range(b + 1, n)])
    return np.array(moves)


def _latencies(
    costs: Float[ndarray, "m m"], weights: Float[ndarray, " m"], orders: Int[ndarray, "k n"], whole_way: float
) -> Float[ndarray, " k"]:
    before = np.concatenate([np.zeros((len(orders), 1), orders.dtype), orders[:, :-1]], axis=1)
    arrival = np.cumsum(costs[before, orders], axis=1)
    latencies: Float[ndarray, " k"] = np.sum(weights[orders] * arrival, axis=1) + whole_way * arrival[:, -1]
    return latencies
