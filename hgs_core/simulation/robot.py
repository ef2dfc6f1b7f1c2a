"""`SimulatedRobot`: a wheeled cylinder among the obstacles of a mesh."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import RobotError
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.kinematics import turned_towards, wrapped
from hgs_core.robot.motion import GroundPose
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState
from hgs_core.robot.tracker import require_followable
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles

_FIRST_WAYPOINT_M = 0.05
_REACHED_M = 1e-9
_CHECK_STEP_M = 0.005
_MARGIN_M = 1e-3
_SAME_CONTACT_M = 0.02


class SimulatedRobot:
    """Implements `Robot` in closed form: turn in place towards the next waypoint, then drive straight.

    Where a waypoint has a yaw it is taken up, by the shorter way round, before the waypoint counts as passed.
    The first waypoint is the robot's own position: within 5 cm of it the robot does not move to it.

    Collisions are found against the obstacles' exact distances: the body advances by its free distance and
    otherwise in steps of 5 mm, which overlooks at most 0.02 mm of a grazed edge. On contact the robot stands
    at the last position before it, drops its path, and counts one collision; pushing again without having
    moved 2 cm is the same contact.
    """

    def __init__(
        self, config: DifferentialConfig, obstacles: BodyObstacles, start: StartPose, robot_id: str = "robot0"
    ) -> None:
        if obstacles.height_m != config.height_m:
            raise RobotError(
                f"obstacles are for a body of {obstacles.height_m} m, the robot is {config.height_m} m high"
            )
        self._config = config
        self._obstacles = obstacles
        self._robot_id = robot_id
        self._position = np.array([start.x_m, start.y_m])
        self._yaw_rad = wrapped(start.yaw_rad)
        self._timestamp_s = 0.0
        self._path_length_m = 0.0
        self._collisions = 0
        self._contact: Float[ndarray, " 2"] | None = None
        self._path = Path.empty()
        self._passed = 0
        self._under_way = False
        self._speed_mps = config.max_speed_mps

    @property
    def state(self) -> RobotState:
        return RobotState(
            x_m=float(self._position[0]),
            y_m=float(self._position[1]),
            yaw_rad=self._yaw_rad,
            timestamp_s=self._timestamp_s,
            path_length_m=self._path_length_m,
            collisions=self._collisions,
            robot_id=self._robot_id,
        )

    @property
    def arrived(self) -> bool:
        return not self._under_way

    @property
    def waypoints_passed(self) -> int:
        return self._passed

    def follow(self, path: Path) -> None:
        if len(path.yaws_rad):
            require_followable(
                path, GroundPose(x_m=self.state.x_m, y_m=self.state.y_m, yaw_rad=self._yaw_rad)
            )
        self._path = path
        self._passed = 0
        self._under_way = len(path.yaws_rad) > 0

    def stop(self) -> None:
        self._under_way = False

    def limit_speed(self, max_speed_mps: float | None) -> None:
        can = self._config.max_speed_mps
        self._speed_mps = can if max_speed_mps is None else min(max_speed_mps, can)

    @property
    def standing_in_s(self) -> float:
        return 0.0

    def advance(self, duration_s: float) -> RobotState:
        if not (duration_s >= 0 and math.isfinite(duration_s)):
            raise RobotError(f"cannot advance by {duration_s} s; expected a finite time of at least 0")
        end_s = self._timestamp_s + duration_s
        left_s: float | None = duration_s
        while self._under_way and left_s is not None:
            left_s = self._towards_next_waypoint(left_s)
        self._timestamp_s = end_s
        return self.state

    def _towards_next_waypoint(self, left_s: float) -> float | None:
        """Moves for at most `left_s`; the seconds left when the waypoint is passed, else None."""
        target = self._path.positions_m[self._passed]
        offset = target - self._position
        distance = float(np.linalg.norm(offset))
        if distance > (_FIRST_WAYPOINT_M if self._passed == 0 else _REACHED_M):
            heading = math.atan2(offset[1], offset[0])
            if (left := self._turn(heading, left_s)) is None:
                return None
            left_s = left
            reach = min(distance, left_s * self._speed_mps)
            if not self._drive(offset / distance, reach) or reach < distance:
                return None
            self._position = target.astype(float)
            left_s -= distance / self._speed_mps
        yaw = float(self._path.yaws_rad[self._passed])
        if not math.isnan(yaw):
            if (left := self._turn(yaw, left_s)) is None:
                return None
            left_s = left
        self._passed += 1
        self._under_way = self._passed < len(self._path.yaws_rad)
        return max(left_s, 0.0)

    def _turn(self, target_rad: float, left_s: float) -> float | None:
        rate = math.radians(self._config.max_turn_rate_degps)
        self._yaw_rad, left_s = turned_towards(self._yaw_rad, target_rad, rate, left_s)
        return left_s if self._yaw_rad == wrapped(target_rad) else None

    def _drive(self, direction: Float[ndarray, " 2"], length_m: float) -> bool:
        """Drives straight; False when something was in the way (the robot then stands before it)."""
        begin = self._position
        radius = self._config.radius_m
        clearance = float(self._obstacles.clearance_m(begin))
        travelled = 0.0
        while travelled < length_m:
            # A little less than the free distance: a contact is then always found by a small step.
            step = min(max(clearance - radius - _MARGIN_M, _CHECK_STEP_M), length_m - travelled)
            ahead = begin + (travelled + step) * direction
            clearance_ahead = float(self._obstacles.clearance_m(ahead))
            # Moving out of an obstacle is allowed, into or deeper into one is not.
            if clearance_ahead <= radius and clearance_ahead < clearance:
                self._touch()
                return False
            travelled += step
            clearance = clearance_ahead
            self._position = ahead
            self._path_length_m += step
            if self._contact is not None and np.linalg.norm(ahead - self._contact) > _SAME_CONTACT_M:
                self._contact = None
        return True

    def _touch(self) -> None:
        if self._contact is None:
            self._collisions += 1
            self._contact = self._position.copy()
        self.stop()

    def snapshot(self) -> dict[str, Any]:
        """Everything that later motion depends on, as plain data; see `restore`."""
        return {
            "position_m": self._position.tolist(),
            "yaw_rad": self._yaw_rad,
            "timestamp_s": self._timestamp_s,
            "path_length_m": self._path_length_m,
            "collisions": self._collisions,
            "contact_m": None if self._contact is None else self._contact.tolist(),
            "path_positions_m": self._path.positions_m.tolist(),
            "path_yaws_rad": self._path.yaws_rad.tolist(),
            "waypoints_passed": self._passed,
            "under_way": self._under_way,
            "speed_mps": self._speed_mps,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._position = np.array(state["position_m"], dtype=float)
        self._yaw_rad = state["yaw_rad"]
        self._timestamp_s = state["timestamp_s"]
        self._path_length_m = state["path_length_m"]
        self._collisions = state["collisions"]
        contact = state["contact_m"]
        self._contact = None if contact is None else np.array(contact, dtype=float)
        self._path = Path(
            positions_m=np.array(state["path_positions_m"], dtype=float).reshape(-1, 2),
            yaws_rad=np.array(state["path_yaws_rad"], dtype=float),
        )
        self._passed = state["waypoints_passed"]
        self._under_way = state["under_way"]
        self._speed_mps = state["speed_mps"]
