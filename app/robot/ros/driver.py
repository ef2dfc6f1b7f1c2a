"""`RosDriver`: turns the mission's paths into velocities for a robot that tells its odometry."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final

from app.robot.ros.odometry import OdometryTrack
from hgs_core.errors import RobotError
from hgs_core.robot.motion import STILL, Twist
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.robot.tracker import PathTracker, tracker_of
from hgs_core.simulation.driven_robot import Moment

TICK_S: Final = 0.05
_TICKS_S: Final = (0.02, 0.2)
"""Least and most that a tick is taken to have lasted, whenever it came."""
_STILL_MPS, _STILL_RADPS = 0.02, 0.05
"""Slower than this an odometry says of a robot that stands."""
_LAST_WORDS: Final = 10
"""So many ticks the robot is told to stand, once it does; then others may drive it."""


class RosDriver:
    """Obeys a `CommandDesk`; `tick`, twenty times a second, says what to drive.

    It accelerates and brakes as the simulated robots do; a robot is expected to follow velocities, and to
    stand by itself when it is told none (as ROS 2 controllers do after half a second).
    """

    def __init__(
        self,
        config: RobotConfig,
        odometry: OdometryTrack,
        publish: Callable[[Twist], None],
        show: Callable[[Path | None], None],
        now_s: Callable[[], float],
    ) -> None:
        """`show` is told the path that is driven, None when there is none any more."""
        self._config = config
        self._odometry = odometry
        self._publish = publish
        self._show = show
        self._now_s = now_s
        self._lock = threading.RLock()
        self._tracker: PathTracker | None = None
        self._passed = 0
        self._max_speed_mps = config.max_speed_mps
        self._reversing = False
        self._last_words = 0
        self._ticked_s = now_s()

    @property
    def moment(self) -> Moment:
        """As the newest odometry has it. Raises `RobotError` before the first."""
        newest = self._odometry.newest
        if newest is None:
            raise RobotError("the robot has not told its odometry yet")
        tracker, twist = self._tracker, newest.twist
        slow = max(abs(twist.forward_mps), abs(twist.left_mps)) < _STILL_MPS
        still = slow and abs(twist.turn_radps) < _STILL_RADPS
        return Moment(
            state=RobotState(
                x_m=newest.at.x_m,
                y_m=newest.at.y_m,
                yaw_rad=newest.at.yaw_rad,
                timestamp_s=newest.stamp_s,
                path_length_m=newest.path_length_m,
                collisions=0,
                reversing=self._reversing,
            ),
            estimate=newest.at,
            twist=twist,
            standing=still and (tracker is None or tracker.standing),
            arrived=tracker is None or tracker.arrived,
            waypoints_passed=self._passed,
        )

    @property
    def stale(self) -> bool:
        """Whether nobody knows where the robot is."""
        return self._odometry.stale(self._now_s())

    def follow(self, path: Path) -> None:
        """From a stand. Raises `RobotError` for a path that does not begin here, and without odometry."""
        with self._lock:
            if self.stale:
                raise RobotError("nothing is heard of the robot's odometry, or too late")
            tracker = None
            if len(path.yaws_rad):
                tracker = tracker_of(self._config, path, self.moment.estimate, self._max_speed_mps)
            self._tracker, self._passed = tracker, 0
            self._show(None if tracker is None else path)

    def stop(self) -> None:
        with self._lock:
            if self._tracker is not None:
                self._tracker.brake()

    def limit_speed(self, max_speed_mps: float | None) -> None:
        with self._lock:
            can = self._config.max_speed_mps
            self._max_speed_mps = can if max_speed_mps is None else min(max_speed_mps, can)
            if self._tracker is not None:
                self._tracker.limit_speed(self._max_speed_mps)

    def tick(self) -> None:
        """Say what to drive until the next tick."""
        with self._lock:
            now_s = self._now_s()
            duration_s = min(max(now_s - self._ticked_s, _TICKS_S[0]), _TICKS_S[1])
            self._ticked_s = now_s
            tracker, here = self._tracker, self._odometry.pose_now(now_s)
            if tracker is None or here is None:
                if self._last_words > 0:
                    self._last_words -= 1
                    self._publish(STILL)
                return
            if self.stale:
                # Nobody knows where it is: braking along a path would be driving blind.
                self._let_go()
                self._publish(STILL)
                return
            twist = tracker.twist(here, duration_s)
            self._passed = tracker.waypoints_passed
            if twist.forward_mps != 0.0:
                self._reversing = twist.forward_mps < 0.0
            if tracker.standing:
                self._let_go()
            self._publish(twist)

    def drop(self) -> None:
        """Stand, whatever it takes: for the end."""
        with self._lock:
            self._let_go()
            for _ in range(3):
                self._publish(STILL)

    def _let_go(self) -> None:
        if self._tracker is not None:
            self._show(None)
        self._tracker, self._last_words = None, _LAST_WORDS
