"""`SimulatedVehicle`: a robot with its drive's kinematics that keeps to a timed path."""

from __future__ import annotations

import math
import threading
from typing import Any, Final

import numpy as np

from hgs_core.errors import RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.motion import GroundPose
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState
from hgs_core.robot.timed_path import TimedPath
from hgs_core.robot.tracker import require_followable
from hgs_core.robot.tracking import steered_curvature
from hgs_core.robot.vehicle import vehicle_of
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.body import Body, pose_from

TICK_S: Final = 0.02
"""The controller decides so often."""
_STANDING_MPS = 1e-6


class SimulatedVehicle:
    """Implements `Robot` for drives that accelerate and brake: holonomic and ackermann.

    A holonomic robot is where its timed path says. A car has the path's speed, and steers: at every tick of
    20 ms its controller looks at where it is and sets a curvature, within what its wheels can be turned to;
    the car then moves along that arc. How time is cut between calls does not matter.

    Told to stop it brakes on its path, and may be told a new one when it stands (`standing_in_s`).

    On contact (see `Body`) the robot stands, and drops its path.
    """

    def __init__(
        self,
        config: AckermannConfig | HolonomicConfig,
        obstacles: BodyObstacles,
        start: StartPose,
        robot_id: str = "robot0",
    ) -> None:
        self._config = config
        self._vehicle = vehicle_of(config)
        self._limit_mps = config.max_speed_mps
        self._body = Body(config, obstacles, start)
        self._robot_id = robot_id
        self._timestamp_s = 0.0
        self._reversing = False
        self._lock = threading.Lock()  # `stop` may come from another thread
        self._timed: TimedPath | None = None
        self._began_s = 0.0
        self._braking = False
        self._passed = 0
        self._tick: tuple[int, GroundPose, float] | None = None
        """The tick under way, the pose at its beginning, and the curvature that was set then."""

    @property
    def state(self) -> RobotState:
        return RobotState(
            x_m=self._pose.x_m,
            y_m=self._pose.y_m,
            yaw_rad=wrapped(self._pose.yaw_rad),
            timestamp_s=self._timestamp_s,
            path_length_m=self._body.path_length_m,
            collisions=self._body.collisions,
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
    def _pose(self) -> GroundPose:
        return self._body.pose

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
        require_followable(path, self._pose)
        self._timed = self._vehicle.timed(path, self._pose.yaw_rad)
        self._began_s = self._timestamp_s

    def _speed_mps(self) -> float:
        return 0.0 if self._timed is None else self._timed.at(self._along_s).speed_mps

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
            self._pose.x_m,
            self._pose.y_m,
            self._pose.yaw_rad,
            wanted,
            reversing=backwards,
            limit_1pm=1.0 / self._config.min_turning_radius_m,
        )

    def _posed(self, timed: TimedPath, until_s: float) -> GroundPose:
        """Where the body is at the end of a part of the tick under way."""
        if not isinstance(self._config, AckermannConfig):
            at = timed.at(until_s)
            return GroundPose(x_m=at.x_m, y_m=at.y_m, yaw_rad=at.yaw_rad)
        assert self._tick is not None
        number, begin, curvature = self._tick
        driven = timed.driven_m(until_s) - timed.driven_m(number * TICK_S)
        yaw = begin.yaw_rad + curvature * driven
        if abs(curvature) < 1e-9:
            step = driven * math.cos(begin.yaw_rad), driven * math.sin(begin.yaw_rad)
        else:
            step = (
                (math.sin(yaw) - math.sin(begin.yaw_rad)) / curvature,
                (math.cos(begin.yaw_rad) - math.cos(yaw)) / curvature,
            )
        return GroundPose(x_m=begin.x_m + step[0], y_m=begin.y_m + step[1], yaw_rad=yaw)

    def _move_to(self, to: GroundPose, driven_m: float) -> bool:
        """Moves the body; False when something was in the way (it then stands before it)."""
        if not self._body.move_to(to):
            self._stand()
            return False
        if driven_m != 0.0:
            self._reversing = driven_m < 0.0
        return True

    def _stand(self) -> None:
        self._timed, self._braking, self._tick = None, False, None

    def snapshot(self) -> dict[str, Any]:
        """Everything that later motion depends on, as plain data; see `restore`."""
        timed = self._timed
        return {
            **self._body.snapshot(),
            "timestamp_s": self._timestamp_s,
            "limit_mps": self._limit_mps,
            "reversing": self._reversing,
            "timed": None if timed is None else {name: getattr(timed, name).tolist() for name in _COLUMNS},
            "began_s": self._began_s,
            "braking": self._braking,
            "waypoints_passed": self._passed,
            "tick": None
            if self._tick is None
            else [self._tick[0], *vars(self._tick[1]).values(), self._tick[2]],
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._body.restore(state)
        self._timestamp_s = state["timestamp_s"]
        self.limit_speed(state["limit_mps"])
        self._reversing = state["reversing"]
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
        self._tick = None if tick is None else (tick[0], pose_from(tick[1:4]), tick[4])


_COLUMNS: Final = ("t_s", "x_m", "y_m", "yaw_rad", "speed_mps", "curvature_1pm", "at_waypoint")
