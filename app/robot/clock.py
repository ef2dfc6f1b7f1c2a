"""The robot's own clock."""

from __future__ import annotations

import time
from collections.abc import Callable


class RobotClock:
    """Seconds since the robot was switched on. What it tells others is ahead of that by `offset_s`: nobody
    may rely on two clocks agreeing."""

    def __init__(self, offset_s: float = 0.0, monotonic_s: Callable[[], float] = time.monotonic) -> None:
        self._offset_s = offset_s
        self._monotonic_s = monotonic_s
        self._began_s = monotonic_s()

    def now_s(self) -> float:
        return self._monotonic_s() - self._began_s

    def told_s(self, time_s: float) -> float:
        """A time of this clock as others are told it."""
        return time_s + self._offset_s
