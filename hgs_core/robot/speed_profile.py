"""How fast to drive along a path: under limits everywhere, accelerating and braking no harder than allowed.

On a straight between two stands this is the trapezoid (a triangle where it is short); limits between them,
as those of curves, cut it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def speeds_along(
    lengths_m: Float[ndarray, " n_segments"],
    limits_mps: Float[ndarray, " n"],
    *,
    acceleration_mps2: float,
    braking_mps2: float,
) -> Float[ndarray, " n"]:
    """The greatest speeds [m/s] at the `n = n_segments + 1` points of a path that keep all limits.

    Where a speed at a point is limited, the robot has slowed down before it: v_k^2 <= v_(k+1)^2 + 2 b s_k.
    The last limit is usually 0: then the robot can stand before the path's end from everywhere on it.
    """
    squares = np.asarray(limits_mps, dtype=np.float64) ** 2
    for k in range(len(lengths_m)):
        squares[k + 1] = min(squares[k + 1], squares[k] + 2.0 * acceleration_mps2 * lengths_m[k])
    for k in range(len(lengths_m) - 1, -1, -1):
        squares[k] = min(squares[k], squares[k + 1] + 2.0 * braking_mps2 * lengths_m[k])
    speeds: Float[ndarray, " n"] = np.sqrt(squares)
    return speeds


def times_along(
    lengths_m: Float[ndarray, " n_segments"], speeds_mps: Float[ndarray, " n"]
) -> Float[ndarray, " n_segments"]:
    """Seconds of each segment under constant acceleration; none may begin and end at a stand."""
    sums = speeds_mps[:-1] + speeds_mps[1:]
    times: Float[ndarray, " n_segments"] = np.where(
        lengths_m > 0.0, 2.0 * lengths_m / np.maximum(sums, 1e-12), 0.0
    )
    return times
