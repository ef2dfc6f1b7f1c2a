"""`DrivenRobot`: a body whose wheels slip, driven by a controller that knows its pose by estimate alone."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Final

from hgs_core.errors import RobotError
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.motion import STILL, GroundPose, Twist, moved
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.robot.tracker import PathTracker, tracker_of
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.body import Body
from hgs_core.simulation.pose_drift import PoseDrift
from hgs_core.simulation.wheel_slip import WheelSlip

TICK_S: Final = 0.02
"""The controller decides so often."""
_KEPT_MOMENTS: Final = 3000
"""One minute: longer than a camera takes for its picture."""


@dataclass(frozen=True, kw_only=True)
class Moment:
    """One tick of a robot's life."""

    state: RobotState
    """Where it truly is."""
    estimate: GroundPose
    """Where it believes to be."""
    twist: Twist
    """How it truly moves."""
    standing: bool
    arrived: bool
    """Whether its path is finished or given up."""
    waypoints_passed: int


class DrivenRobot:
    """Implements `Robot`, in ticks of 20 ms: what is left of a duration is lived through with the next.

    Its controller follows the path by the estimated pose; what it is in the way of is judged by the true one
    (see `Body`). On contact it stands, and drops its path.

    One thread lets time pass; `follow`, `stop`, `limit_speed` and readers may come from others.
    """

    def __init__(
        self,
        config: RobotConfig,
        obstacles: BodyObstacles,
        start: StartPose,
        *,
        slip: WheelSlip,
        drift: PoseDrift,
        robot_id: str = "robot0",
    ) -> None:
        self._config = config
        self._body = Body(config, obstacles, start)
        self._slip = slip
        self._drift = drift
        self._robot_id = robot_id
        self._estimate = self._body.pose
        self._tracker: PathTracker | None = None
        self._passed = 0
        self._max_speed_mps = config.max_speed_mps
        self._reversing = False
        self._ticks = 0
        self._remainder_s = 0.0
        self._lock = threading.RLock()
        self._moments: deque[Moment] = deque([self._moment(STILL)], maxlen=_KEPT_MOMENTS)

    @property
    def moment(self) -> Moment:
        """The newest one, whole."""
        return self._moments[-1]

    def moment_at(self, timestamp_s: float) -> Moment:
        """That of the tick at `timestamp_s`. Raises `RobotError` when it is forgotten, or yet to come."""
        with self._lock:
            back = self._ticks - round(timestamp_s / TICK_S)
            if not 0 <= back < len(self._moments):
                raise RobotError(
                    f"nothing is known of {timestamp_s:.2f} s: it is {self._ticks * TICK_S:.2f} s"
                )
            return self._moments[-1 - back]

    @property
    def state(self) -> RobotState:
        return self.moment.state

    @property
    def arrived(self) -> bool:
        return self.moment.arrived

    @property
    def waypoints_passed(self) -> int:
        return self.moment.waypoints_passed

    @property
    def standing_in_s(self) -> float:
        with self._lock:
            return 0.0 if self._tracker is None else self._tracker.standing_in_s

    def follow(self, path: Path) -> None:
        """See `Robot`. A path that begins near by replaces one that is driven only once the robot stands:
        raises `RobotError` while it drives, too."""
        with self._lock:
            if not self.moment.standing:
                raise RobotError("the robot is driving: stop it, and give it a new path when it stands")
            tracker = None
            if len(path.yaws_rad):
                tracker = tracker_of(self._config, path, self._estimate, self._max_speed_mps)
            self._tracker, self._passed = tracker, 0
            self._renew()

    def stop(self) -> None:
        with self._lock:
            if self._tracker is not None:
                self._tracker.brake()
                self._renew()

    def limit_speed(self, max_speed_mps: float | None) -> None:
        with self._lock:
            can = self._config.max_speed_mps
            self._max_speed_mps = can if max_speed_mps is None else min(max_speed_mps, can)
            if self._tracker is not None:
                self._tracker.limit_speed(self._max_speed_mps)
                self._renew()

    def advance(self, duration_s: float) -> RobotState:
        if not (duration_s >= 0 and math.isfinite(duration_s)):
            raise RobotError(f"cannot advance by {duration_s} s; expected a finite time of at least 0")
        self._remainder_s += duration_s
        while self._remainder_s >= TICK_S - 1e-9:
            self._remainder_s = max(self._remainder_s - TICK_S, 0.0)
            self.tick()
        return self.state

    def tick(self) -> Moment:
        """Lives through one tick."""
        with self._lock:
            tracker, before = self._tracker, self._body.pose
            commanded = STILL if tracker is None else tracker.twist(self._estimate, TICK_S)
            true = self._slip.applied(commanded, TICK_S)
            if not true.is_still and not self._body.move_to(moved(before, true, TICK_S)):
                true, self._tracker = STILL, None
            self._estimate = self._drift.moved(self._estimate, before, self._body.pose)
            if true.forward_mps != 0.0:
                self._reversing = true.forward_mps < 0.0
            if tracker is not None:
                self._passed = tracker.waypoints_passed
                if tracker.standing:
                    self._tracker = None
            self._ticks += 1
            self._moments.append(self._moment(true))
            return self.moment

    def _renew(self) -> None:
        """What is decided between two ticks shows at once."""
        self._moments[-1] = self._moment(self.moment.twist)

    def _moment(self, twist: Twist) -> Moment:
        tracker, pose = self._tracker, self._body.pose
        return Moment(
            state=RobotState(
                x_m=pose.x_m,
                y_m=pose.y_m,
                yaw_rad=wrapped(pose.yaw_rad),
                timestamp_s=self._ticks * TICK_S,
                path_length_m=self._body.path_length_m,
                collisions=self._body.collisions,
                reversing=self._reversing,
                robot_id=self._robot_id,
            ),
            estimate=self._estimate,
            twist=twist,
            standing=tracker is None or tracker.standing,
            arrived=tracker is None or tracker.arrived,
            waypoints_passed=self._passed,
        )
