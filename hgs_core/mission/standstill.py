"""`Standstill`: how many plans in a row have not moved the robot."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hgs_core.robot.robot import RobotState

_MOVED_M: Final = 0.05
_TURNED_RAD: Final = float(np.radians(5.0))


class Standstill:
    """Counts plans (and ways of the pilot's own) that left the robot where it was."""

    def __init__(self) -> None:
        self.plans = 0
        self._pose = (np.inf, np.inf, np.inf)

    def note(self, robot: RobotState) -> None:
        """There is another plan now, and the robot is here."""
        x_m, y_m, yaw_rad = self._pose
        turned = np.inf
        if np.isfinite(yaw_rad):
            turned = abs((robot.yaw_rad - yaw_rad + np.pi) % (2 * np.pi) - np.pi)
        moved = np.hypot(robot.x_m - x_m, robot.y_m - y_m)
        self.plans = self.plans + 1 if moved < _MOVED_M and turned < _TURNED_RAD else 0
        self._pose = (robot.x_m, robot.y_m, robot.yaw_rad)

    def forgive(self) -> None:
        """It stood for a reason: count anew."""
        self.plans = 0

    def state(self) -> dict[str, Any]:
        return {"plans": self.plans, "pose": list(self._pose)}

    def restore(self, state: dict[str, Any]) -> None:
        self.plans = int(state["plans"])
        x_m, y_m, yaw_rad = state["pose"]
        self._pose = (x_m, y_m, yaw_rad)
