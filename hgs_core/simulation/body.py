"""`Body`: what a simulated robot pushes about among true obstacles."""

from __future__ import annotations

import math
from typing import Any, Final

from hgs_core.errors import RobotError
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.motion import GroundPose
from hgs_core.robot.robot import RobotConfig
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.footprint import footprint_of

_CHECK_STEP_M: Final = 0.005
_SAME_CONTACT_M: Final = 0.02


class Body:
    """A footprint with a pose. It is held against the obstacles' exact distances wherever it may have come
    near one, every 5 mm (a rectangle to 2 mm).

    On contact it stands at the last pose before it, and one collision is counted; pushing again without
    having moved 2 cm is the same contact.
    """

    def __init__(self, config: RobotConfig, obstacles: BodyObstacles, start: StartPose) -> None:
        if obstacles.height_m != config.height_m:
            raise RobotError(
                f"obstacles are for a body of {obstacles.height_m} m, the robot is {config.height_m} m high"
            )
        self.pose = GroundPose(x_m=start.x_m, y_m=start.y_m, yaw_rad=wrapped(start.yaw_rad))
        """Its yaw need not be wrapped."""
        self.path_length_m = 0.0
        self.collisions = 0
        self._footprint = footprint_of(config)
        self._obstacles = obstacles
        self._contact: GroundPose | None = None
        self._room_m = 0.0

    def move_to(self, to: GroundPose) -> bool:
        """Moves by less than half a turn; False when something was in the way (it then stands before it)."""
        begin = self.pose
        turned = wrapped(to.yaw_rad - begin.yaw_rad)
        moved = math.hypot(to.x_m - begin.x_m, to.y_m - begin.y_m) + abs(turned) * self._footprint.reach_m
        n = 1 if moved < self._room_m else max(1, math.ceil(moved / _CHECK_STEP_M))
        for k in range(1, n + 1):
            share = k / n
            ahead = GroundPose(
                x_m=begin.x_m + share * (to.x_m - begin.x_m),
                y_m=begin.y_m + share * (to.y_m - begin.y_m),
                yaw_rad=begin.yaw_rad + share * turned,
            )
            left = self._room_m - moved / n
            if left <= 0.0:
                left = self._footprint.room_m(self._obstacles, ahead.x_m, ahead.y_m, ahead.yaw_rad)
                if left <= 0.0:
                    self._touch()
                    return False
            self._room_m, self.pose = left, ahead
        self.path_length_m += math.hypot(to.x_m - begin.x_m, to.y_m - begin.y_m)
        contact = self._contact
        if contact is not None and math.hypot(to.x_m - contact.x_m, to.y_m - contact.y_m) > _SAME_CONTACT_M:
            self._contact = None
        return True

    def _touch(self) -> None:
        if self._contact is None:
            self.collisions += 1
            self._contact = self.pose

    def snapshot(self) -> dict[str, Any]:
        """Everything that later motion depends on, as plain data; see `restore`."""
        return {
            "pose": [*vars(self.pose).values()],
            "path_length_m": self.path_length_m,
            "collisions": self.collisions,
            "contact": None if self._contact is None else [*vars(self._contact).values()],
            "room_m": self._room_m,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self.pose = pose_from(state["pose"])
        self.path_length_m = state["path_length_m"]
        self.collisions = state["collisions"]
        self._contact = None if state["contact"] is None else pose_from(state["contact"])
        self._room_m = state["room_m"]


def pose_from(numbers: list[float]) -> GroundPose:
    x_m, y_m, yaw_rad = numbers
    return GroundPose(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
