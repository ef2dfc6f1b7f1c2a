"""Motion of a differential drive that turns in place and drives straight, in closed form."""

from __future__ import annotations

import math


def wrapped(angle_rad: float) -> float:
    """The same direction in (-pi, pi]."""
    turned = math.remainder(angle_rad, 2 * math.pi)
    return math.pi if turned == -math.pi else turned


def turned_towards(
    yaw_rad: float, target_rad: float, rate_radps: float, available_s: float
) -> tuple[float, float]:
    """The shortest turn from `yaw_rad` towards `target_rad`: the yaw reached and the seconds left over.

    The target was reached exactly when the returned yaw equals `wrapped(target_rad)`.
    """
    difference = wrapped(target_rad - yaw_rad)
    needed_s = abs(difference) / rate_radps
    if needed_s <= available_s:
        return wrapped(target_rad), available_s - needed_s
    return wrapped(yaw_rad + math.copysign(rate_radps * available_s, difference)), 0.0
