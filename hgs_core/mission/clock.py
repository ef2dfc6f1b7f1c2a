"""What mission time is: counted in nominal steps, or what everything really took."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final, Protocol, runtime_checkable

_POLL_S: Final = 0.02
IDLE_SHARE: Final = 0.1
"""Share of a frame's interval that the mapper leaves to everything else: the service, events, the system."""


class ClockKind(StrEnum):
    """The two clocks that the one loop runs by."""

    LOCKSTEP = "lockstep"
    """Steps cost nominal times: the same seed gives the same mission on any machine, however loaded."""
    REAL = "real"
    """Steps cost what they take: mapper and planner keep up with the robot, or frames are lost."""


@dataclass(frozen=True, kw_only=True)
class NextFrame:
    """The frame to take next."""

    after_s: float
    """Mission seconds from the latest moment the clock has told."""
    dropped: int
    """Frames that fell due before it and were never taken."""


@runtime_checkable
class Clock(Protocol):
    """Mission time. It is handed out in pieces, each of which the robot then lives through."""

    kind: ClockKind
    world_goes_on: bool
    """Whether the robot lives on while the loop is busy, and must be told to stand where it should."""

    def elapsed_s(self, *, nominal_s: float) -> float:
        """Mission seconds since the latest moment told, for a step whose nominal cost is `nominal_s`."""
        ...

    def stopped(self) -> AbstractContextManager[None]:
        """The simulator is at work inside: mission time stands still."""
        ...

    def paused(self) -> AbstractContextManager[None]:
        """The mission waits inside: mission time stands still."""
        ...

    @property
    def time_left(self) -> Callable[[], bool] | None:
        """Whether there is time for an optimisation step before the next frame; None: steps are counted."""
        ...

    def next_frame(self, *, interrupted: Callable[[], bool]) -> NextFrame:
        """Wait until a frame is due, or until `interrupted`, which is polled meanwhile."""
        ...

    def state(self) -> dict[str, Any]:
        """What a clock of another process needs to go on from here, as plain data."""
        ...

    def restore(self, state: dict[str, Any]) -> None: ...


class LockstepClock:
    """Every step takes its nominal time; a frame is due one interval after the step before it."""

    kind = ClockKind.LOCKSTEP
    world_goes_on = False
    time_left = None

    def __init__(self, frame_interval_s: float) -> None:
        self._frame_interval_s = frame_interval_s

    def elapsed_s(self, *, nominal_s: float) -> float:
        return nominal_s

    def stopped(self) -> AbstractContextManager[None]:
        return nullcontext()

    def paused(self) -> AbstractContextManager[None]:
        return nullcontext()

    def next_frame(self, *, interrupted: Callable[[], bool]) -> NextFrame:
        return NextFrame(after_s=self._frame_interval_s, dropped=0)

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""


class RealClock:
    """Mission time is wall time, but for what happens in `stopped`. It begins when it is first asked.

    Frames fall due every `frame_interval_s`, the first at once. Whoever comes late takes the newest that has
    fallen due, and those before it are dropped: never more than one waits. Optimisation may go on until
    `IDLE_SHARE` of the interval is left before the next is due.
    """

    kind = ClockKind.REAL
    world_goes_on = False

    def __init__(
        self,
        frame_interval_s: float,
        *,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._frame_interval_s = frame_interval_s
        self._now = now
        self._sleep = sleep
        self._began_s: float | None = None
        self._told_s = 0.0
        self._next_index = 1

    def elapsed_s(self, *, nominal_s: float) -> float:
        time_s = max(self._time_s(), self._told_s)
        elapsed_s = time_s - self._told_s
        self._told_s = time_s
        return elapsed_s

    @contextmanager
    def stopped(self) -> Iterator[None]:
        time_s = self._time_s()
        try:
            yield
        finally:
            self._began_s = self._now() - time_s

    def paused(self) -> AbstractContextManager[None]:
        return self.stopped()

    @property
    def time_left(self) -> Callable[[], bool] | None:
        until_s = (self._next_index - IDLE_SHARE) * self._frame_interval_s
        return lambda: self._time_s() < until_s

    def next_frame(self, *, interrupted: Callable[[], bool]) -> NextFrame:
        due_s = self._next_index * self._frame_interval_s
        while (wait_s := due_s - self._time_s()) > 0 and not interrupted():
            self._sleep(min(wait_s, _POLL_S))
        newest = max(self._next_index, int(self._time_s() / self._frame_interval_s))
        dropped = newest - self._next_index
        self._next_index = newest + 1
        # A frame that fell due while a plan was made is taken now: the robot stood, and cannot be put back.
        frame_s = max(newest * self._frame_interval_s, self._told_s)
        after_s = frame_s - self._told_s
        self._told_s = frame_s
        return NextFrame(after_s=after_s, dropped=dropped)

    def state(self) -> dict[str, Any]:
        return {"time_s": self._time_s(), "told_s": self._told_s, "next_index": self._next_index}

    def restore(self, state: dict[str, Any]) -> None:
        """Mission time goes on from where it stood: none has passed since."""
        self._began_s = self._now() - state["time_s"]
        self._told_s = state["told_s"]
        self._next_index = state["next_index"]

    def _time_s(self) -> float:
        now_s = self._now()
        if self._began_s is None:
            self._began_s = now_s
        return now_s - self._began_s


def clock_of(kind: ClockKind, frame_interval_s: float) -> Clock:
    """The clock of that kind for a camera that delivers a frame every `frame_interval_s`."""
    if kind is ClockKind.REAL:
        return RealClock(frame_interval_s)
    return LockstepClock(frame_interval_s)
