"""What a mission's process tells twice, or told when nobody listened, makes one gapless log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.missions.degrees import in_degrees
from app.missions.event_log import EventLog
from hgs_core.mission.repeats import NO_REPEATS, Repeats, happened


class Retelling:
    """Of one mission; `log()` holds what the service was told of it."""

    def __init__(self, log: Callable[[], EventLog]) -> None:
        self.told_until_s = -math.inf
        """Mission time up to which everything has been told; later views and events are news."""
        self._log = log
        self._repeats = NO_REPEATS

    def is_news(self, shown: dict[str, Any]) -> bool:
        """Whether an event is told for the first time; to be asked once of every event, in order."""
        return not self._repeats.holds(shown)

    def go_on_from(self, time_s: float, run: Path) -> None:
        """A process goes on from this moment: what was told of later ones is not told again, and what the
        process before it wrote into the folder of its `run` without being heard is told now."""
        self.tell_what_was_missed(run, until_s=time_s)
        told = self._log().told_since(time_s)
        self._repeats = Repeats(told)
        self.told_until_s = max((float(event["time_s"]) for event in told), default=time_s)

    def tell_what_was_missed(self, run: Path, *, until_s: float = math.inf) -> None:
        """A process that has lost its service goes on for a while, and what it tells then is in its own log
        alone, in the folder of its run."""
        log = self._log()
        newest = log.newest("telemetry")
        since_s = 0.0 if newest is None else float(newest["time_s"])
        known = Repeats(log.told_since(since_s))
        for event in happened(run / "events.jsonl", since_s=since_s, until_s=until_s):
            shown = in_degrees(event)
            if not known.holds(shown):
                log.append({"received_at": time.time(), **shown})
