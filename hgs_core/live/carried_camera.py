"""`CarriedCamera`: what a mission drives that nobody can drive."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from hgs_core.live.correspondence import Correspondence
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState


class CarriedCamera:
    """Implements `Robot` for a camera that somebody carries, or a recording: it goes where it goes."""

    def __init__(self, correspondence: Correspondence) -> None:
        self._correspondence = correspondence
        self._state = RobotState(
            x_m=0.0, y_m=0.0, yaw_rad=0.0, timestamp_s=0.0, path_length_m=0.0, collisions=0
        )
        self._began = False

    @property
    def state(self) -> RobotState:
        return replace(self._state, timestamp_s=self._correspondence.time_s)

    @property
    def arrived(self) -> bool:
        """Never: nothing is to be planned for it."""
        return False

    @property
    def waypoints_passed(self) -> int:
        return 0

    @property
    def standing_in_s(self) -> float:
        return 0.0

    def follow(self, path: Path) -> None:
        """Nobody obeys."""

    def advance(self, duration_s: float) -> RobotState:
        self._correspondence.wait_for_news(duration_s, lambda: False)
        return self.state

    def stop(self) -> None:
        """Nobody obeys."""

    def limit_speed(self, max_speed_mps: float | None) -> None:
        """Nobody obeys."""

    def has_moved(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """The camera of the newest frame is there."""
        step = float(np.hypot(x_m - self._state.x_m, y_m - self._state.y_m)) if self._began else 0.0
        self._began = True
        path_m = self._state.path_length_m + step
        self._state = replace(self._state, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, path_length_m=path_m)

    def state_to_keep(self) -> dict[str, Any]:
        return {"path_length_m": self._state.path_length_m}

    def restore(self, state: dict[str, Any]) -> None:
        self._state = replace(self._state, path_length_m=float(state["path_length_m"]))
