"""How far a grid is, and how long the rest may take."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hgs_core.benchmark.planners.cell import CellKey, CellResult, CellStatus
from hgs_core.benchmark.planners.grid import PlannedCell


@dataclass(kw_only=True)
class GridProgress:
    """Counts of cells, and what those that ended tell about those that are left."""

    asked: int
    kept: tuple[PlannedCell, ...]
    """Finished by an earlier call."""
    slots: int
    done: int = 0
    """Finished, those kept included."""
    failed: int = 0
    waiting: list[CellKey] = field(default_factory=list)
    running: dict[CellKey, float] = field(default_factory=dict)
    """And when each began (monotonic clock)."""
    _seconds: dict[str, list[float]] = field(default_factory=dict)
    """By scene, what its finished cells took."""

    @staticmethod
    def begin(cells: Sequence[PlannedCell], left: Sequence[PlannedCell], *, slots: int) -> GridProgress:
        missing = {cell.key for cell in left}
        kept = tuple(cell for cell in cells if cell.key not in missing)
        waiting = [cell.key for cell in left]
        return GridProgress(asked=len(cells), kept=kept, slots=slots, done=len(kept), waiting=waiting)

    def learn(self, result: CellResult) -> None:
        """What a finished cell took, mission and evaluation."""
        if result.report is not None:
            parts = [result.report.get("wall_s"), result.report.get("evaluation_s")]
            self._seconds.setdefault(result.key.scene, []).append(sum(part or 0.0 for part in parts))

    def started(self, key: CellKey) -> None:
        self.waiting.remove(key)
        self.running[key] = time.monotonic()

    def ended(self, result: CellResult) -> None:
        seconds = time.monotonic() - self.running.pop(result.key)
        if result.status is CellStatus.FINISHED:
            self.done += 1
            self._seconds.setdefault(result.key.scene, []).append(seconds)
        else:
            self.failed += 1

    @property
    def left(self) -> int:
        return len(self.waiting) + len(self.running)

    def left_s(self) -> float | None:
        """Wall seconds until the end, from the mean of cells on the same scene, or on any; None before there
        is one."""
        if not self._seconds:
            return None
        anywhere = float(np.mean([one for seconds in self._seconds.values() for one in seconds]))
        now = time.monotonic()

        def expected(key: CellKey) -> float:
            known = self._seconds.get(key.scene)
            return anywhere if known is None else float(np.mean(known))

        rests = [max(expected(key) - (now - began), 0.0) for key, began in self.running.items()]
        work = sum(rests) + sum(expected(key) for key in self.waiting)
        longest = max(rests, default=0.0)
        return max(longest, work / max(1, min(self.slots, self.left)))
