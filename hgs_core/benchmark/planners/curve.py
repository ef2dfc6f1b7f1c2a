"""Completion over the way driven, and what is read off such curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import ConfigError


@dataclass(frozen=True, kw_only=True, eq=False)
class CompletionCurve:
    """Observable completion ratio along one mission, at samples in the order of time."""

    path_m: Float[ndarray, " n"]
    """Never falls; stays the same while the robot turns on the spot."""
    time_s: Float[ndarray, " n"]
    ratio: Float[ndarray, " n"]

    @staticmethod
    def of(report: Mapping[str, Any]) -> CompletionCurve | None:
        """`completion_curve` of a report (a list of `{path_m, time_s, ratio}`); None where it has none.

        Raises `ConfigError` where the samples are not in the order of the way.
        """
        samples = report.get("completion_curve")
        if not samples:
            return None
        columns = {
            name: np.array([float(sample[name]) for sample in samples])
            for name in ("path_m", "time_s", "ratio")
        }
        curve = CompletionCurve(**columns)
        for name in ("path_m", "time_s"):
            if not (np.isfinite(columns[name]).all() and (np.diff(columns[name]) >= 0).all()):
                raise ConfigError(f"completion_curve of {report.get('scene')}: {name} must never fall")
        return curve


def area_under(curve: CompletionCurve, length_m: float) -> float:
    """Mean completion ratio over the first `length_m` of way, the final value held after the mission's end.

    Trapezoids between the samples, from ratio 0 at the start of the way. `length_m` is at least the
    curve's own length.
    """
    if length_m < curve.path_m[-1]:
        raise ValueError(f"the curve is {curve.path_m[-1]} m long, longer than {length_m} m")
    path = np.concatenate([[0.0], curve.path_m, [length_m]])
    ratio = np.concatenate([[0.0], curve.ratio, curve.ratio[-1:]])
    return float(np.trapezoid(ratio, path) / length_m)


def held(
    x: Float[ndarray, " n"], ratio: Float[ndarray, " n"], at: Float[ndarray, " m"]
) -> Float[ndarray, " m"]:
    """`ratio` at the places `at`, linear between samples, the last value of samples at one place, the final
    value behind the end, and rising from 0 before the first."""
    last = np.append(np.diff(x) > 0, True)
    x, ratio = x[last], ratio[last]
    if x[0] > 0:
        x, ratio = np.append(0.0, x), np.append(0.0, ratio)
    return np.interp(at, x, ratio)


def longest_m(curves: Sequence[CompletionCurve]) -> float:
    """Length of the longest way among missions on one scene [m]; 0 without any."""
    return max((float(curve.path_m[-1]) for curve in curves), default=0.0)
