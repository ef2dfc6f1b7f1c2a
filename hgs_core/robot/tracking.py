"""Keeping a car to its path: the path's own curvature, corrected by how far it is off.

Off by `e` to the left of the path and by `a` in heading, a car that drives `ds` (gear g = +-1) gets
`de = g a ds` and `da = g (curvature - path's) ds`. With `curvature = path's - e / l^2 - 2 g a / l` that is
`e'' = -e / l^2 - 2 e' / l`: both die out within a few lengths `l`, without overshoot, in either gear.
"""

from __future__ import annotations

import math
from typing import Final

from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.timed_path import PathPose

CORRECTION_LENGTH_M: Final = 0.25
"""l: within about four of these a car is back on its path [m]."""


def steered_curvature(
    x_m: float, y_m: float, yaw_rad: float, wanted: PathPose, *, reversing: bool, limit_1pm: float
) -> float:
    """The curvature [1/m] to drive now, at most `limit_1pm` to either side."""
    dx, dy = x_m - wanted.x_m, y_m - wanted.y_m
    aside = -math.sin(wanted.yaw_rad) * dx + math.cos(wanted.yaw_rad) * dy
    off = wrapped(yaw_rad - wanted.yaw_rad)
    gear = -1.0 if reversing else 1.0
    corrected = wanted.curvature_1pm - aside / CORRECTION_LENGTH_M**2 - 2.0 * gear * off / CORRECTION_LENGTH_M
    return min(max(corrected, -limit_1pm), limit_1pm)
