"""`LiveRobot`: the robot at the other end of a correspondence, as the loop drives it."""

from __future__ import annotations

import threading
import time
from typing import Any, Final

import numpy as np

from hgs_core.errors import RobotError
from hgs_core.live.config import LiveConfig
from hgs_core.live.correspondence import Correspondence
from hgs_core.live.messages import Ack, FollowPath, Hello, LimitSpeed, Report, Stop
from hgs_core.live.odometer import Odometer
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState
from hgs_core.robot.timed_path import TimedPath
from hgs_core.robot.vehicle import Vehicle

_LOOK_S: Final = 0.02


class LiveRobot:
    """Implements `Robot`. Where it is, is what it reported last; how far it is on its path, what it had
    reported when the newest frame was taken, so that nobody believes to have seen what is still to come.

    A path counts as finished, and the robot is told to stop, when it refuses the path, does not say in time
    that it obeys, strays from it, or comes back after a silence; a notice says so.
    """

    def __init__(
        self, correspondence: Correspondence, vehicle: Vehicle, config: LiveConfig, first: Report
    ) -> None:
        """`first`: what it said of itself when the mission began."""
        self._correspondence = correspondence
        self._vehicle = vehicle
        self._config = config
        self._lock = threading.RLock()
        self._command = 0
        self._path = Path.empty()
        self._moving = 0
        """The newest command that moves the robot or lets it stand."""
        self._following: int | None = None
        """The command whose path it is on its way along."""
        self._told_at_s: float | None = None
        """When that was sent, as long as it has not said that it obeys."""
        self._limit_mps: float | None = None
        self._seen: Report | None = None
        self._known = Odometer(first)

    @property
    def state(self) -> RobotState:
        report = self._correspondence.report
        if report is None:
            raise RobotError("the robot has not said where it is")
        with self._lock:
            path_m, collisions = self._known.totals()
        return RobotState(
            x_m=report.x_m,
            y_m=report.y_m,
            yaw_rad=report.yaw_rad,
            timestamp_s=self._correspondence.time_s,
            path_length_m=path_m,
            collisions=collisions,
            reversing=report.reversing,
        )

    @property
    def arrived(self) -> bool:
        with self._lock:
            seen = self._seen
            if self._following is None:
                return True
            return seen is not None and self._is_on_path(seen) and seen.arrived

    @property
    def waypoints_passed(self) -> int:
        with self._lock:
            seen = self._seen
            if seen is None or not self._is_on_path(seen):
                return 0
            return min(seen.waypoints_passed, len(self._path.yaws_rad))

    @property
    def standing_in_s(self) -> float:
        report = self._correspondence.report
        with self._lock:
            stands = report is not None and report.standing and report.command >= self._moving
        return 0.0 if stands else self._config.stand_s

    def follow(self, path: Path) -> None:
        with self._lock:
            self._path = path
            if not len(path.yaws_rad):
                self._following = None
                return
            timed = self._vehicle.timed(path, self.state.yaw_rad)
            self._following = self._moving = self._next_command()
            self._told_at_s = self._correspondence.now_s
            self._correspondence.send(
                FollowPath(
                    now_s=self._correspondence.now_s,
                    command=self._following,
                    valid_for_s=self._config.command_s,
                    positions_m=path.positions_m.tolist(),
                    yaws_rad=[None if np.isnan(yaw) else float(yaw) for yaw in path.yaws_rad],
                    headings_rad=None if path.headings_rad is None else path.headings_rad.tolist(),
                    timed=_columns(timed),
                )
            )

    def advance(self, duration_s: float) -> RobotState:
        """Wait until it stands, at most so long."""
        until = time.monotonic() + duration_s
        while time.monotonic() < until and self.standing_in_s > 0.0:
            time.sleep(_LOOK_S)
        return self.state

    def stop(self) -> None:
        self._stop("the mission says so")

    def limit_speed(self, max_speed_mps: float | None) -> None:
        with self._lock:
            self._limit_mps = max_speed_mps
            self._correspondence.send(
                LimitSpeed(
                    now_s=self._correspondence.now_s,
                    command=self._next_command(),
                    max_speed_mps=max_speed_mps,
                )
            )

    def has_seen(self, report: Report | None) -> None:
        """The frame of that moment is what is decided on now."""
        with self._lock:
            self._seen = report

    def on_hello(self, _: Hello) -> None:
        """It is back: whatever it was on its way to, it is to stand, and told anew what holds."""
        with self._lock:
            self._seen = None
            self._stop("it is back: its path is planned anew")
            if self._limit_mps is not None:
                self.limit_speed(self._limit_mps)

    def on_report(self, report: Report) -> None:
        with self._lock:
            self._known.take(report)
            following = self._following
            if following is None:
                return
            if report.command == following:
                self._told_at_s = None
            if not self._is_on_path(report):
                return
            astray_m = _distance_m(report, self._path)
        if astray_m > self._config.off_path_m:
            self._give_up(following, f"the robot is {astray_m:.2f} m off its path")

    def on_ack(self, ack: Ack) -> None:
        with self._lock:
            if ack.command != self._following:
                return
            self._told_at_s = None
        if not ack.accepted:
            self._give_up(ack.command, f"the robot refuses the path: {ack.reason}")

    def on_beat(self) -> None:
        """Time has passed: was the newest path obeyed, and does anybody look where it leads?"""
        with self._lock:
            following, told_at = self._following, self._told_at_s
        if following is None:
            return
        if told_at is not None and self._correspondence.now_s - told_at > self._config.command_s:
            self._give_up(
                following, f"the robot has not taken its path up within {self._config.command_s:g} s"
            )
        elif self._correspondence.blind_s > self._config.frame_s:
            self._give_up(following, f"no frame has been looked at for {self._config.frame_s:g} s")

    def state_to_keep(self) -> dict[str, Any]:
        with self._lock:
            return {"command": self._command, "limit_mps": self._limit_mps, "known": self._known.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """In another process: the robot is where it says; its counters go on."""
        with self._lock:
            self._command = self._moving = int(state["command"])
            self._known.restore(state["known"])
        self.limit_speed(state["limit_mps"])

    def _is_on_path(self, report: Report) -> bool:
        """Whether it tells of the path that is under way: what comes after a path and is neither path nor
        stop, a limit of speed, leaves it under way."""
        following = self._following
        if following is None or report.command < following:
            return False
        return report.command == following or self._told_at_s is None

    def _give_up(self, command: int, why: str) -> None:
        """Stop the robot, unless it has been told something else meanwhile."""
        with self._lock:
            if self._following != command:
                return
            self._stop(why)
        self._correspondence.notice(f"{why}: another is made")

    def _stop(self, reason: str) -> None:
        with self._lock:
            self._following = self._told_at_s = None
            self._moving = self._next_command()
            self._correspondence.send(
                Stop(now_s=self._correspondence.now_s, command=self._moving, reason=reason)
            )

    def _next_command(self) -> int:
        self._command += 1
        return self._command


def _columns(timed: TimedPath) -> dict[str, list[float]]:
    names = ("t_s", "x_m", "y_m", "yaw_rad", "speed_mps", "curvature_1pm")
    return {name: getattr(timed, name).tolist() for name in names}


def _distance_m(report: Report, path: Path) -> float:
    """From the robot to the nearest place of its path [m], arcs taken as their chords."""
    point = np.array([report.x_m, report.y_m])
    begins, ends = path.positions_m[:-1], path.positions_m[1:]
    if not len(begins):
        return float(np.hypot(*(path.positions_m[0] - point)))
    steps = ends - begins
    squares = np.maximum((steps**2).sum(axis=1), 1e-12)
    share = np.clip(((point - begins) * steps).sum(axis=1) / squares, 0.0, 1.0)
    return float(np.hypot(*(begins + share[:, None] * steps - point).T).min())
