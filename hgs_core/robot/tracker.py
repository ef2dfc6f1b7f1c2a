"""`PathTracker`: what turns a path and an estimated pose into velocities, tick after tick."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from hgs_core.errors import ConfigError, RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.motion import GroundPose, Twist
from hgs_core.robot.path import Path
from hgs_core.robot.pure_pursuit import PurePursuit
from hgs_core.robot.robot import RobotConfig
from hgs_core.robot.timed_tracker import TimedTracker

BEGINS_WITHIN_M = 0.25
"""A path that begins farther from the robot is for another place."""
BEGINS_WITHIN_RAD = float(np.radians(20.0))
"""Likewise for a car's heading."""


@runtime_checkable
class PathTracker(Protocol):
    """Drives one path, from a stand to a stand. Time is what `twist` is told of."""

    @property
    def waypoints_passed(self) -> int:
        """Of the path, taken-up yaws included."""
        ...

    @property
    def arrived(self) -> bool:
        """Whether the path is finished or given up: what is left is to come to a stand."""
        ...

    @property
    def standing(self) -> bool:
        """Whether nothing is left to do at all."""
        ...

    @property
    def standing_in_s(self) -> float:
        """Seconds from `brake` to a stand."""
        ...

    def twist(self, pose: GroundPose, duration_s: float) -> Twist:
        """What to drive for the next `duration_s`, being (as far as is known) at `pose`."""
        ...

    def brake(self) -> None:
        """Give the path up and come to a stand along it, as fast as the brakes allow."""
        ...

    def limit_speed(self, max_speed_mps: float) -> None:
        """Drive no faster from now on [m/s]; a tracker that cannot slow down on its way brakes."""
        ...


def require_followable(path: Path, pose: GroundPose) -> None:
    """Raises `RobotError` for a path that is not finite or does not begin near `pose`."""
    if not np.all(np.isfinite(path.positions_m)) or np.any(np.isinf(path.yaws_rad)):
        raise RobotError("the path holds positions or yaws that are not finite")
    if path.headings_rad is not None and not np.all(np.isfinite(path.headings_rad)):
        raise RobotError("the path holds headings that are not finite")
    away = float(np.hypot(*(path.positions_m[0] - [pose.x_m, pose.y_m])))
    if away > BEGINS_WITHIN_M:
        raise RobotError(
            f"the path begins {away:.2f} m from the robot at ({pose.x_m:.2f}, {pose.y_m:.2f}); "
            f"it must begin within {BEGINS_WITHIN_M} m"
        )
    if path.headings_rad is not None:
        off = abs(wrapped(float(path.headings_rad[0]) - pose.yaw_rad))
        if off > BEGINS_WITHIN_RAD:
            raise RobotError(f"the path begins {np.degrees(off):.0f} degrees from the robot's heading")


def tracker_of(config: RobotConfig, path: Path, pose: GroundPose, max_speed_mps: float) -> PathTracker:
    """The tracker for a drive, set on a path of at least one waypoint from a stand at `pose`.

    Raises `RobotError` for a path that does not begin there or that the drive cannot follow, and
    `ConfigError` for settings of none of the drives.
    """
    require_followable(path, pose)
    if isinstance(config, DifferentialConfig):
        return PurePursuit(config, path, pose, max_speed_mps)
    if isinstance(config, AckermannConfig | HolonomicConfig):
        return TimedTracker(config, path, pose, max_speed_mps)
    raise ConfigError(f"no controller drives a {config.drive!r} robot along a path")
