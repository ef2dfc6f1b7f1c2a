"""`CommandDesk`: which of the service's commands the robot obeys."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from hgs_core.errors import RobotError
from hgs_core.live.messages import Ack, FollowPath, LimitSpeed, Stop
from hgs_core.robot.path import Path
from hgs_core.simulation.driven_robot import Moment

_REMEMBERED: Final = 100
"""Answers that are kept for commands that come twice."""
_MOST_WAYPOINTS: Final = 100_000


class Obedient(Protocol):
    """What a desk commands: see `Robot`."""

    @property
    def moment(self) -> Moment: ...
    def follow(self, path: Path) -> None: ...
    def stop(self) -> None: ...
    def limit_speed(self, max_speed_mps: float | None) -> None: ...


class CommandDesk:
    """Obeys, or refuses and says why.

    A path is refused when it comes too late, is older than a command that was obeyed, is not finite, or does
    not begin near the robot. A command that comes twice is answered as the first time and not obeyed again.
    A robot that is driving brakes first, and takes the new path up when it stands.

    How late a command comes is its age by the service's clock, as far as it can be known without comparing
    clocks: the least difference of the two clocks over the messages of a connection stands for one that
    travelled without delay.

    Commands may come from one thread, and time (`settle`) from another.
    """

    def __init__(self, robot: Obedient, say: Callable[[Ack], None]) -> None:
        self._robot = robot
        self._say = say
        self._lock = threading.Lock()
        self._least_s = math.inf
        self._newest = 0
        """The newest number obeyed within this connection."""
        self._obeyed = 0
        self._waiting: tuple[FollowPath, Path] | None = None
        self._answers: dict[int, Ack] = {}
        self.accepted = 0
        self.refused = 0

    @property
    def obeyed(self) -> int:
        """The newest command that the robot obeys; 0 = none yet."""
        return self._obeyed

    def begin(self) -> None:
        """A new connection: perhaps another service with another clock, whose commands count from 1."""
        with self._lock:
            self._least_s, self._newest = math.inf, 0
            self._answers.clear()
            self._waiting = None

    def heard(self, now_s: float, received_s: float) -> None:
        """A message of the service's time `now_s` has come, at `received_s` by the robot's clock."""
        if math.isfinite(now_s):
            self._least_s = min(self._least_s, received_s - now_s)

    def obey(self, command: FollowPath | Stop | LimitSpeed, received_s: float) -> None:
        """Answers at once, or, for a path that waits for the robot to stand, from `settle`."""
        with self._lock:
            if (before := self._answers.get(command.command)) is not None and not isinstance(command, Stop):
                self._say(before)
                return
            if self._waiting is not None and command.command == self._waiting[0].command:
                return
            reason = ""
            if isinstance(command, Stop):
                self._give_up_waiting(f"command {command.command} stopped the robot before it")
                self._robot.stop()
            elif command.command < self._newest:
                reason = f"command {self._newest} is newer, and was obeyed"
            elif isinstance(command, LimitSpeed):
                reason = self._limit(command.max_speed_mps)
            else:
                path, reason = self._taken(command, received_s)
                if path is not None:
                    self._take_up(command, path)
                    return
            self._answer(command.command, reason)

    def settle(self) -> None:
        """To be called after every tick: a path that waits is taken up once the robot stands."""
        if self._waiting is None or not self._robot.moment.standing:
            return
        with self._lock:
            if self._waiting is not None:
                self._follow(*self._waiting)

    def drop(self, reason: str) -> None:
        """The robot stops by itself: what waits is refused."""
        with self._lock:
            self._give_up_waiting(reason)

    def _limit(self, max_speed_mps: float | None) -> str:
        if max_speed_mps is not None and not (math.isfinite(max_speed_mps) and max_speed_mps > 0.0):
            return f"{max_speed_mps} m/s is no speed limit"
        self._robot.limit_speed(max_speed_mps)
        return ""

    def _taken(self, command: FollowPath, received_s: float) -> tuple[Path | None, str]:
        """The path, or why it is not driven."""
        age_s = received_s - command.now_s - self._least_s
        if not (math.isfinite(command.now_s) and age_s <= command.valid_for_s):
            return None, f"it comes {age_s:.2f} s late, and was valid for {command.valid_for_s:.2f} s"
        try:
            return path_of(command), ""
        except RobotError as error:
            return None, str(error)

    def _take_up(self, command: FollowPath, path: Path) -> None:
        if self._robot.moment.standing:
            self._follow(command, path)
            return
        self._give_up_waiting(f"command {command.command} came before the robot stood")
        self._robot.stop()
        self._waiting = command, path

    def _follow(self, command: FollowPath, path: Path) -> None:
        self._waiting = None
        try:
            self._robot.follow(path)
        except RobotError as error:
            self._answer(command.command, str(error))
        else:
            self._answer(command.command, "")

    def _give_up_waiting(self, reason: str) -> None:
        if self._waiting is not None:
            command, self._waiting = self._waiting[0], None
            self._answer(command.command, reason)

    def _answer(self, number: int, reason: str) -> None:
        if reason:
            self.refused += 1
        else:
            self.accepted += 1
            self._newest = max(self._newest, number)
            self._obeyed = self._newest
        printable = "".join(character if character.isprintable() else " " for character in reason)
        ack = Ack(command=number, accepted=not reason, reason=printable[:300])
        self._answers[number] = ack
        if len(self._answers) > _REMEMBERED:
            self._answers.pop(next(iter(self._answers)))
        self._say(ack)


def path_of(command: FollowPath) -> Path:
    """The path that a command names. Raises `RobotError` for what is none."""
    n = len(command.positions_m)
    if n > _MOST_WAYPOINTS:
        raise RobotError(f"the path has {n} waypoints, more than {_MOST_WAYPOINTS}")
    if any(len(position) != 2 for position in command.positions_m):
        raise RobotError("the path's positions must be pairs of numbers [m]")
    headings = command.headings_rad
    if len(command.yaws_rad) != n or (headings is not None and len(headings) != n):
        n_headings = "no" if headings is None else len(headings)
        raise RobotError(
            f"the path has {n} positions, {len(command.yaws_rad)} yaws and {n_headings} headings: one each, "
            "or no headings at all"
        )
    if not all(math.isfinite(value) for position in command.positions_m for value in position):
        raise RobotError("the path holds positions that are not finite")
    if not all(math.isfinite(yaw) for yaw in [*command.yaws_rad, *(headings or [])] if yaw is not None):
        raise RobotError("the path holds yaws or headings that are not finite")
    yaws = [math.nan if yaw is None else yaw for yaw in command.yaws_rad]
    return Path(
        positions_m=np.array(command.positions_m, dtype=np.float64).reshape(n, 2),
        yaws_rad=np.array(yaws, dtype=np.float64),
        headings_rad=None if headings is None else np.array(headings, dtype=np.float64),
    )
