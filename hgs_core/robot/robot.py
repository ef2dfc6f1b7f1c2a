"""The seam between the loop and a vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.robot.path import Path

STEP_HEIGHT_M: Final = 0.05
"""Default of `RobotConfig.step_height_m`, and what counts as floor when a scene is judged."""


class RobotConfig(StrictConfig):
    """What every wheeled robot has. How it drives is its subclasses' (`vehicle.py`)."""

    drive: str
    """`differential`, `holonomic` or `ackermann`."""
    radius_m: float = Field(0.25, gt=0)
    """Of the disc about the robot's axis that places and scenes are judged by [m]: the footprint of a round
    robot; a car needs as much beside its rear axle, and more ahead."""
    height_m: float = Field(1.1, gt=0)
    """Height of the body above the floor [m]."""
    step_height_m: float = Field(STEP_HEIGHT_M, ge=0)
    """Wheels climb what is lower than this [m]: rugs, thresholds, cables."""
    max_speed_mps: float = Field(1.0, gt=0)
    """Driving speed [m/s]."""


@dataclass(frozen=True, kw_only=True)
class RobotState:
    """Where the robot is, and what it has done so far. `collisions` counts contacts, not ticks."""

    x_m: float
    y_m: float
    yaw_rad: float
    timestamp_s: float
    path_length_m: float
    collisions: int
    reversing: bool = False
    """Whether it drives backwards, or last did."""
    robot_id: str = "robot0"


@runtime_checkable
class Robot(Protocol):
    """A vehicle that follows one path at a time."""

    @property
    def state(self) -> RobotState: ...

    @property
    def arrived(self) -> bool:
        """Whether the current path is finished (true before the first path, and after `stop`)."""
        ...

    @property
    def waypoints_passed(self) -> int:
        """How many waypoints of the current path have been reached, taken-up yaws included."""
        ...

    def follow(self, path: Path) -> None:
        """Replace the current path. Raises `RobotError` when it does not begin near the robot."""
        ...

    def advance(self, duration_s: float) -> RobotState:
        """Let `duration_s` seconds pass."""
        ...

    def stop(self) -> None:
        """Drop the current path and come to a stand on it, as fast as the robot may brake."""
        ...

    @property
    def standing_in_s(self) -> float:
        """Seconds until a robot that was told to stop stands; 0 when it does."""
        ...

    def limit_speed(self, max_speed_mps: float | None) -> None:
        """Drive no faster than this from now on [m/s], and no faster than the robot can; None: as it can."""
        ...
