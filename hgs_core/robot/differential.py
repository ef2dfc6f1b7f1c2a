"""A robot on two driven wheels: it turns on the spot and drives straight ahead."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.robot.timed_path import TimedPath, TimedPathBuilder


class DifferentialConfig(RobotConfig):
    """An upright cylinder that turns in place and drives forward; it has its speed at once."""

    drive: Literal["differential"] = "differential"
    max_turn_rate_degps: float = Field(60.0, gt=0)
    """Turning rate in place [degrees/s]."""


class Differential:
    """Implements `Vehicle`."""

    def __init__(self, config: DifferentialConfig) -> None:
        self.config = config

    def first_look(self, state: RobotState) -> Path:
        return Path.full_turn(state.x_m, state.y_m, state.yaw_rad)

    def timed(self, path: Path, yaw_rad: float) -> TimedPath:
        """See `Vehicle`: a turn towards every waypoint, a straight way to it, and a turn to its yaw."""
        speed, rate = self.config.max_speed_mps, np.radians(self.config.max_turn_rate_degps)
        timed = TimedPathBuilder(path.positions_m[0], yaw_rad)
        for position, yaw in zip(path.positions_m, path.yaws_rad, strict=True):
            step = position - timed.position_m
            length = float(np.hypot(*step))
            if length > 0.0:
                heading = float(np.arctan2(step[1], step[0]))
                timed.add(abs(wrapped(heading - timed.yaw_rad)) / rate, yaw_rad=heading)
                timed.add(0.0, speed_mps=speed)
                timed.add(length / speed, position_m=position, speed_mps=speed)
                timed.add(0.0, speed_mps=0.0)
            if np.isfinite(yaw):
                timed.add(abs(wrapped(float(yaw) - timed.yaw_rad)) / rate, yaw_rad=float(yaw))
            timed.reached_waypoint()
        return timed.built()
