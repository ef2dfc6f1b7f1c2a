"""`SimulatedVehicle`: a robot with its drive's kinematics that keeps to a timed path."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from hgs_core.errors import RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState
from hgs_core.robot.timed_path import TimedPath
from hgs_core.robot.tracking import steered_curvature
from hgs_core.robot.vehicle import vehicle_of
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.footprint import footprint_of

TICK_S: Final = 0.02
"""The controller decides so often."""
_BEGINS_WITHIN_M = 0.25
_BEGINS_WITHIN_RAD = math.radians(20.0)
_CHECK_STEP_M = 0.005
_SAME_CONTACT_M = 0.02
_STANDING_MPS = 1e-6


@dataclass(frozen=True)
class _Pose:
    x: float
    y: float
    yaw: float


class SimulatedVehicle:
    """Implements `Robot` for drives that accelerate and brake: holonomic and ackermann.

    A holonomic robot is where its timed path says. A car has the path's speed, and steers: at every tick of
    20 ms its controller looks at where it is and sets a curvature, within what its wheels can be turned to;
    the car then moves along that arc. How time is cut between calls does not matter.

    Told to stop it brakes on its path, and may be told a new one when it stands (`standing_in_s`).

    The body's footprint is held against the obstacles' exact distances wherever it may have come near one,
    every 5 mm (a rectangle to 2 mm). On contact the robot stands at the last pose before it, drops its path,
    and counts one collision; pushing again without having moved 2 cm is the same contact.
    """

    def __init__(
        self,
        config: AckermannConfig | HolonomicConfig,
        obstacles: BodyObstacles,
        start: StartPose,
        robot_id: str = "robot0",
    ) -> None:
        if obstacles.height_m != config.height_m:
            raise RobotError(
                f"obstacles are for a body of {obstacles.height_m} m, the robot is {config.height_m} m high"
            )
        self._config = config
        self._vehicle = vehicle_of(config)
        self._limit_mps = config.max_speed_mps
        self._footprint = footprint_of(config)
        self._obstacles = obstacles
        self._robot_id = robot_id
        self._pose = _Pose(start.x_m, start.y_m, wrapped(start.yaw_rad))
        self._timestamp_s = 0.0
        self._path_length_m = 0.0
        self._collisions = 0
        self._reversing = False
        self._contact: _Pose | None = None
        self._room_m = 0.0
        self._lock = threading.Lock()  # `stop` may come from another thread
        self._timed: TimedPath | None = None
        self._began_s = 0.0
        self._braking = False
        self._passed = 0
        self._tick: tuple[int, _Pose, float] | None = None
        """The tick under way, the pose at its beginning, and the curvature that was set then."""

    @property
    def state(self) -> RobotState:
        return RobotState(
            x_m=self._pose.x,
            y_m=self._pose.y,
            yaw_rad=wrapped(self._pose.yaw),
            timestamp_s=self._timestamp_s,
            path_length_m=self._path_length_m,
            collisions=self._collisions,
            reversing=self._reversing,
            robot_id=self._robot_id,
        )

    @property
    def arrived(self) -> bool:
        return self._timed is None or self._braking

    @property
    def waypoints_passed(self) -> int:
        return self._passed

    @property
    def standing_in_s(self) -> float:
        if self._timed is None:
            return 0.0
        if self._braking:
            return max(0.0, self._began_s + self._timed.duration_s - self._timestamp_s)
        return self._timed.braking_from(self._along_s, self._config.max_braking_mps2).duration_s

    @property
    def _along_s(self) -> float:
        return self._timestamp_s - self._began_s

    def limit_speed(self, max_speed_mps: float | None) -> None:
        """See `Robot`. Driving faster than that, it brakes to a stand: the next path keeps to the limit."""
        can = self._config.max_speed_mps
        limit = can if max_speed_mps is None else min(max_speed_mps, can)
        limited: dict[str, float] = {"max_speed_mps": limit}
        if isinstance(self._config, AckermannConfig):
            limited["max_reverse_speed_mps"] = min(self._config.max_reverse_speed_mps, limit)
        self._limit_mps = limit
        self._vehicle = vehicle_of(self._config.model_copy(update=limited))
        if abs(self._speed_mps()) > limit:
            self.stop()

    def follow(self, path: Path) -> None:
        if self.standing_in_s > _STANDING_MPS and abs(self._speed_mps()) > _STANDING_MPS:
            raise RobotError("the robot is driving: stop it, and give it a new path when it stands")
        self._timed, self._braking, self._passed, self._tick = None, False, 0, None
        if not len(path.yaws_rad):
            return
        self._check(path)
        self._timed = self._vehicle.timed(path, self._pose.yaw)
        self._began_s = self._timestamp_s

    def _speed_mps(self) -> float:
        return 0.0 if self._timed is None else self._timed.at(self._along_s).speed_mps

    def _check(self, path: Path) -> None:
        if not np.all(np.isfinite(path.positions_m)) or np.any(np.isinf(path.yaws_rad)):
            raise RobotError("the path holds positions or yaws that are not finite")
        away = float(np.hypot(*(path.positions_m[0] - [self._pose.x, self._pose.y])))
        if away > _BEGINS_WITHIN_M:
            raise RobotError(
                f"the path begins {away:.2f} m from the robot at ({self._pose.x:.2f}, {self._pose.y:.2f}); "
                f"it must begin within {_BEGINS_WITHIN_M} m"
            )
        if path.headings_rad is not None:
            off = abs(wrapped(float(path.headings_rad[0]) - self._pose.yaw))
            if not off <= _BEGINS_WITHIN_RAD:
                raise RobotError(f"the path begins {math.degrees(off):.0f} degrees from the robot's heading")

    def stop(self) -> None:
        with self._lock:
            if self._timed is None or self._braking:
                return
            self._timed = self._timed.braking_from(self._along_s, self._config.max_braking_mps2)
            self._began_s, self._braking, self._tick = self._timestamp_s, True, None
            if self._timed.duration_s <= 0.0:
                self._stand()

    def advance(self, duration_s: float) -> RobotState:
        if not (duration_s >= 0 and math.isfinite(duration_s)):
            raise RobotError(f"cannot advance by {duration_s} s; expected a finite time of at least 0")
        end_s = self._timestamp_s + duration_s
        while self._timestamp_s < end_s:
            with self._lock:
                if self._timed is None:
                    break
                self._advance_within_tick(self._timed, end_s)
        self._timestamp_s = end_s
        return self.state

    def _advance_within_tick(self, timed: TimedPath, end_s: float) -> None:
        """On to the end of the tick, of the path or of the time, whichever comes first."""
        now = self._along_s
        number = math.floor(now / TICK_S + 1e-6)
        until = min((number + 1) * TICK_S, timed.duration_s, end_s - self._began_s)
        if self._tick is None or self._tick[0] != number:
            self._tick = (number, self._pose, self._steered(timed, now))
        if not self._move_to(self._posed(timed, until), timed.driven_m(until) - timed.driven_m(now)):
            return
        self._timestamp_s = min(self._began_s + until, end_s)
        self._passed = int(np.count_nonzero(timed.t_s[timed.at_waypoint] <= until + 1e-9))
        if until >= timed.duration_s:
            self._stand()

    def _steered(self, timed: TimedPath, now_s: float) -> float:
        if not isinstance(self._config, AckermannConfig):
            return 0.0
        wanted = timed.at(now_s)
        ahead = timed.at(now_s + 0.5 * TICK_S)
        backwards = ahead.speed_mps < 0.0
        return steered_curvature(
            self._pose.x,
            self._pose.y,
            self._pose.yaw,
            wanted,
            reversing=backwards,
            limit_1pm=1.0 / self._config.min_turning_radius_m,
        )

    def _posed(self, timed: TimedPath, until_s: float) -> _Pose:
        """Where the body is at the end of a part of the tick under way."""
        if not isinstance(self._config, AckermannConfig):
            at = timed.at(until_s)
            return _Pose(at.x_m, at.y_m, at.yaw_rad)
        assert self._tick is not None
        number, begin, curvature = self._tick
        driven = timed.driven_m(until_s) - timed.driven_m(number * TICK_S)
        yaw = begin.yaw + curvature * driven
        if abs(curvature) < 1e-9:
            step = driven * math.cos(begin.yaw), driven * math.sin(begin.yaw)
        else:
            step = (
                (math.sin(yaw) - math.sin(begin.yaw)) / curvature,
                (math.cos(begin.yaw) - math.cos(yaw)) / curvature,
            )
        return _Pose(begin.x + step[0], begin.y + step[1], yaw)

    def _move_to(self, to: _Pose, driven_m: float) -> bool:
        """Moves the body; False when something was in the way (it then stands before it)."""
        begin = self._pose
        moved = math.hypot(to.x - begin.x, to.y - begin.y) + abs(to.yaw - begin.yaw) * self._footprint.reach_m
        n = 1 if moved < self._room_m else max(1, math.ceil(moved / _CHECK_STEP_M))
        for k in range(1, n + 1):
            share = k / n
            ahead = _Pose(
                begin.x + share * (to.x - begin.x),
                begin.y + share * (to.y - begin.y),
                begin.yaw + share * (to.yaw - begin.yaw),
            )
            left = self._room_m - moved / n
            if left <= 0.0:
                left = self._footprint.room_m(self._obstacles, ahead.x, ahead.y, ahead.yaw)
                if left <= 0.0:
                    self._touch()
                    return False
            self._room_m, self._pose = left, ahead
        self._path_length_m += math.hypot(to.x - begin.x, to.y - begin.y)
        if driven_m != 0.0:
            self._reversing = driven_m < 0.0
        contact = self._contact
        if contact is not None and math.hypot(to.x - contact.x, to.y - contact.y) > _SAME_CONTACT_M:
            self._contact = None
        return True

    def _touch(self) -> None:
        if self._contact is None:
            self._collisions += 1
            self._contact = self._pose
        self._stand()

    def _stand(self) -> None:
        self._timed, self._braking, self._tick = None, False, None

    def snapshot(self) -> dict[str, Any]:
        """Everything that later motion depends on, as plain data; see `restore`."""
        timed = self._timed
        return {
            "pose": [self._pose.x, self._pose.y, self._pose.yaw],
            "timestamp_s": self._timestamp_s,
            "path_length_m": self._path_length_m,
            "collisions": self._collisions,
            "limit_mps": self._limit_mps,
            "reversing": self._reversing,
            "contact": None if self._contact is None else [*vars(self._contact).values()],
            "room_m": self._room_m,
            "timed": None if timed is None else {name: getattr(timed, name).tolist() for name in _COLUMNS},
            "began_s": self._began_s,
            "braking": self._braking,
            "waypoints_passed": self._passed,
            "tick": None
            if self._tick is None
            else [self._tick[0], *vars(self._tick[1]).values(), self._tick[2]],
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._pose = _Pose(*state["pose"])
        self._timestamp_s = state["timestamp_s"]
        self._path_length_m = state["path_length_m"]
        self._collisions = state["collisions"]
        self.limit_speed(state["limit_mps"])
        self._reversing = state["reversing"]
        self._contact = None if state["contact"] is None else _Pose(*state["contact"])
        self._room_m = state["room_m"]
        timed = state["timed"]
        self._timed = (
            None
            if timed is None
            else TimedPath(
                **{
                    name: np.array(timed[name], dtype=np.float64)
                    for name in _COLUMNS
                    if name != "at_waypoint"
                },
                at_waypoint=np.array(timed["at_waypoint"], dtype=np.int64),
            )
        )
        self._began_s = state["began_s"]
        self._braking = state["braking"]
        self._passed = state["waypoints_passed"]
        tick = state["tick"]
        self._tick = None if tick is None else (tick[0], _Pose(*tick[1:4]), tick[4])


_COLUMNS: Final = ("t_s", "x_m", "y_m", "yaw_rad", "speed_mps", "curvature_1pm", "at_waypoint")
