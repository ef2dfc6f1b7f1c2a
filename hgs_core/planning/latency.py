"""In which order to take views when what is gained early counts more: least latency, weighed by gain.

A shortest tour visits everything with the least driving, whatever it gains when. The area above the curve of
what has been gained over time is the sum of `gain * time of arrival`: an order that makes it small (the
weighted travelling repairman problem) takes first what shows much unless it is far, but drives to and fro
when nothing stands out, and leaves what is small for long ways back. A weighted sum of both has neither
fault.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.native import kernels

_MAX_SWEEPS = 60
"""Improvements of one start: each takes the best of all moves, so that few are needed."""


def least_latency_order(
    costs: Float[ndarray, "n_all n_all"], gains: Float[ndarray, " n"], *, urgency: float
) -> Int[ndarray, " n"]:
    """Places 1..n, from place 0, in the order that makes `urgency * A + (1 - urgency) * L` small.

    `A` is the mean time of arrival, weighed by gain, `L` the time of the last arrival. `costs[a, b]` is the
    time from place `a` to place `b`, finite, and may be asymmetric; `gains[k]`, not negative, belongs to
    place `k + 1`. Local search (one place moved elsewhere, or a stretch reversed; the best of all
    moves each time) from two starts: nearest first, and most gain for the time first.
    Deterministic. Raises `PlanningError` for a cost that is not finite.
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
    return min(improved, key=lambda one: one[0])[1]


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
) -> tuple[float, Int[ndarray, " n"]]:
    improved, latency = kernels.improve_latency(
        np.ascontiguousarray(costs, np.float64), weights, whole_way, _MAX_SWEEPS, order.astype(np.int32)
    )
    return latency, improved.astype(np.int64)
