"""Settings of a mission with a live robot."""

from __future__ import annotations

from pydantic import Field

from hgs_core.config.base import StrictConfig


class LiveConfig(StrictConfig):
    """How long either side waits for the other, and what is explored where the robot does not say."""

    dead_man_s: float = Field(2.0, gt=0)
    """The robot stops by itself when it has heard nothing for so long; the mission pauses when it has [s]."""
    frame_s: float = Field(4.0, gt=0)
    """Likewise without a frame: a robot that cannot see must not drive [s]."""
    command_s: float = Field(1.0, gt=0)
    """Within which a robot must say that it obeys a path; later it refuses it, and another is made [s]."""
    stand_s: float = Field(2.0, gt=0)
    """The longest wait for a robot that was told to stop [s]."""
    off_path_m: float = Field(0.5, gt=0)
    """A robot that has strayed so far from its path is stopped, and another is made [m]."""
    extent_m: float = Field(24.0, gt=0, le=200)
    """Side of the square about the robot that is explored where it names no region [m]."""
    height_m: float = Field(3.0, gt=0, le=50)
    """Height of that region above the floor [m]."""
