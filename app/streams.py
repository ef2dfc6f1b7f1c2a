"""Live events for one reader, over whatever carries them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable
from typing import Any, Final

import anyio
from starlette.concurrency import run_in_threadpool

from app.event_texts import EventTexts
from app.missions.mission import Mission
from app.wakes import Wakes

QUIET_S: Final = 5.0
"""A quiet stream says `alive` so often, so that a page can tell silence from a lost connection."""


class Streams:
    """Every open stream, so that all of them end when the service does."""

    def __init__(self, *, on_skipped: Callable[[int], None] = lambda _: None) -> None:
        """`on_skipped` is told how many telemetry events a reader missed because it was slow."""
        self._ended = False
        self._pauses: set[asyncio.Event] = set()
        self._on_skipped = on_skipped
        self._wakes = Wakes()
        self.texts = EventTexts()

    @property
    def ended(self) -> bool:
        return self._ended

    def end(self) -> None:
        """End all streams; call it from the event loop."""
        self._ended = True
        for pause in self._pauses:
            pause.set()
        self._wakes.wake_all()

    def n_readers(self, mission: Mission) -> int:
        """How many follow it now."""
        return self._wakes.n_readers(mission.log)

    async def pause(self, seconds: float) -> None:
        """Wait so long, or until streams end."""
        ended = asyncio.Event()
        self._pauses.add(ended)
        try:
            if not self._ended:
                with anyio.move_on_after(seconds):
                    await ended.wait()
        finally:
            self._pauses.discard(ended)

    async def follow(
        self, mission: Mission, cursor: int, *, allowed: Callable[[], bool]
    ) -> AsyncGenerator[dict[str, Any]]:
        """Events after number `cursor` as they come, until the service ends or the reader may no longer.

        A reader that cannot keep up misses telemetry, never a change of state: it is given what is new when
        it asks again, and nothing is kept for it. `{"kind": "alive"}` has no sequence number.
        """
        log = await run_in_threadpool(lambda: mission.log)
        up_to_date = False
        with self._wakes.reader(log) as changed:
            while allowed() and not self._ended:
                changed.clear()
                events = log.live(cursor)
                if events is None:
                    events = await run_in_threadpool(log.catch_up, cursor)
                if events and up_to_date:
                    # All that is not telemetry is there: what is missing among the numbers, is.
                    self._on_skipped(events[-1]["sequence"] - cursor - len(events))
                up_to_date = True
                for event in events:
                    yield event
                    cursor = event["sequence"]
                if events or self._ended:
                    continue
                with anyio.move_on_after(QUIET_S) as quiet:
                    await changed.wait()
                if quiet.cancelled_caught:
                    yield {"kind": "alive", "state": str(mission.state), "silent_s": mission.silent_s}
