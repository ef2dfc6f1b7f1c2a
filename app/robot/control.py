"""`ControlLoop`: the robot lives, fifty times a second, whatever camera and network do."""

from __future__ import annotations

import threading
from collections.abc import Callable

from app.robot.clock import RobotClock
from app.robot.commands import CommandDesk
from app.robot.dead_man import DeadMan
from hgs_core.simulation.driven_robot import TICK_S, DrivenRobot, Moment


class ControlLoop:
    """Brings the body up to the robot's clock, tick by tick, in a thread of its own.

    A tick that comes late is lived through all the same, as of the time at which it was due: the body moves
    as it would under a controller that is never late, and what is heard counts from when it was heard.
    """

    def __init__(
        self,
        robot: DrivenRobot,
        desk: CommandDesk,
        dead_man: DeadMan,
        clock: RobotClock,
        say: Callable[[str], None],
    ) -> None:
        self.late_s: list[float] = []
        """By how much each waking came after the tick that it was for."""
        self.dead_man_stops = 0
        self.stopping_m: list[float] = []
        self._robot = robot
        self._desk = desk
        self._dead_man = dead_man
        self._clock = clock
        self._say = say
        self._braked_at_m: float | None = None
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)

    @property
    def lived_s(self) -> float:
        """How long the body has lived."""
        return self._robot.state.timestamp_s

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()

    def live_until(self, now_s: float) -> None:
        """All ticks that are due."""
        while (due_s := self.lived_s + TICK_S) <= now_s:
            self._tick(due_s)

    def _run(self) -> None:
        while not self._over.is_set():
            due_s = self.lived_s + TICK_S
            left_s = due_s - self._clock.now_s()
            if left_s > 0.0:
                self._over.wait(left_s)
            now_s = self._clock.now_s()
            self.late_s.append(max(now_s - due_s, 0.0))
            self.live_until(now_s)

    def _tick(self, due_s: float) -> None:
        if self._dead_man.trips(due_s):
            self._brake(self._robot.moment)
        moment = self._robot.tick()
        if self._braked_at_m is not None and moment.standing:
            self.stopping_m.append(moment.state.path_length_m - self._braked_at_m)
            self._braked_at_m = None
        self._desk.settle()

    def _brake(self, moment: Moment) -> None:
        self.dead_man_stops += 1
        self._desk.drop("nothing was heard of the service: the robot has stopped by itself")
        self._robot.stop()
        if moment.standing:
            self._say(f"nothing heard for {self._dead_man.limit_s:g} s: the robot stays where it stands")
            return
        self._say(f"nothing heard for {self._dead_man.limit_s:g} s: the robot brakes and drops its path")
        if self._braked_at_m is None:
            self._braked_at_m = moment.state.path_length_m
