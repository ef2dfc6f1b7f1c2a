"""`Helm`: gives the robot its ways until it is halted, from whichever thread."""

from __future__ import annotations

import threading

from hgs_core.robot.path import Path
from hgs_core.robot.robot import Robot, RobotState


class Helm:
    """After `halt` nothing moves the robot any more, whatever another thread was about to ask of it."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._lock = threading.Lock()
        self._halted = False

    def follow(self, path: Path) -> None:
        with self._lock:
            if not self._halted:
                self._robot.follow(path)

    def halt(self) -> RobotState:
        """Let the robot stand, for good. Returns where it stands."""
        with self._lock:
            self._halted = True
            self._robot.stop()
            return self._robot.state
