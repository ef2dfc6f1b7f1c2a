"""Where cells are run: `Engine`, and the engine of this machine's own processes."""

from __future__ import annotations

import os
import time
from typing import Final, Protocol, runtime_checkable

from hgs_core.benchmark.planners.cell_process import CellProcess
from hgs_core.benchmark.planners.task import CellAnswer, CellTask

_POLL_S: Final = 0.05


@runtime_checkable
class Engine(Protocol):
    """Runs cells, up to `slots` of them beside each other, each in a process of its own."""

    @property
    def name(self) -> str: ...

    @property
    def slots(self) -> int: ...

    def start(self, task: CellTask) -> None:
        """Begin; at most `slots` tasks may be under way."""
        ...

    def ended(self, timeout_s: float) -> list[tuple[CellTask, CellAnswer]]:
        """Tasks that ended since the last call; waits until there is one, at most `timeout_s`."""
        ...

    def close(self) -> None:
        """Kill what is under way and let go of everything. May be called again."""
        ...


class ProcessEngine:
    """Processes of this machine."""

    name = "processes"

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self._running: list[CellProcess] = []

    def start(self, task: CellTask) -> None:
        self._running.append(CellProcess(task))

    def ended(self, timeout_s: float) -> list[tuple[CellTask, CellAnswer]]:
        until = time.monotonic() + timeout_s
        while True:
            ended = [process for process in self._running if process.ended()]
            if ended or time.monotonic() >= until:
                self._running = [process for process in self._running if process not in ended]
                return [(process.task, process.answer()) for process in ended]
            time.sleep(_POLL_S)

    def close(self) -> None:
        while self._running:
            self._running.pop().kill()


def default_slots(threads: int) -> int:
    """How many missions of so many threads the processors at hand can run."""
    return max(1, len(os.sched_getaffinity(0)) // threads)
