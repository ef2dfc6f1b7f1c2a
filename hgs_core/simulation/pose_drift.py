"""A pose estimate that drifts, as that of odometry does."""

from __future__ import annotations

import math

import numpy as np

from hgs_core.errors import ConfigError
from hgs_core.robot.motion import GroundPose


class PoseDrift:
    """A random walk: after one metre the estimate is off by `percent` of that metre along and across, and by
    `deg_per_m` degrees, standard deviations each; after d metres by sqrt(d) times as much, and by what the
    wrong heading adds.

    Turning on the spot adds nothing. Draws three numbers a step, whatever was driven.
    """

    def __init__(self, percent: float, deg_per_m: float, rng: np.random.Generator) -> None:
        if not (0.0 <= percent < 100.0 and 0.0 <= deg_per_m < 90.0):
            raise ConfigError(
                f"pose drift of {percent} % and {deg_per_m} deg/m: expected at least 0, "
                "below 100 % and below 90 deg/m"
            )
        self._share = percent / 100.0
        self._rad = math.radians(deg_per_m)
        self._rng = rng

    def moved(self, estimate: GroundPose, before: GroundPose, after: GroundPose) -> GroundPose:
        """The estimate after the robot has truly moved from `before` to `after`."""
        ahead, across, turn = self._rng.standard_normal(3).tolist()
        if before == after:
            return estimate
        step = after.seen_from(before)
        root_m = math.sqrt(math.hypot(step.x_m, step.y_m))
        return estimate.then(
            GroundPose(
                x_m=step.x_m + self._share * root_m * ahead,
                y_m=step.y_m + self._share * root_m * across,
                yaw_rad=step.yaw_rad + self._rad * root_m * turn,
            )
        )
