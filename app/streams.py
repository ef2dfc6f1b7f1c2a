"""Live events for one reader, over whatever carries them."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections import OrderedDict
from collections.abc import AsyncGenerator, Callable
from typing import Any, Final

import anyio
from starlette.concurrency import run_in_threadpool

from app.missions.mission import Mission
from app.storage.missions import Event

QUIET_S: Final = 5.0
"""A quiet stream says `alive` so often, so that a page can tell silence from a lost connection."""


_TEXTS_KEPT: Final = 64


class Streams:
    """Every open stream, so that all of them end when the service does."""

    def __init__(self, *, on_skipped: Callable[[int], None] = lambda _: None) -> None:
        """`on_skipped` is told how many telemetry events a reader missed because it was slow."""
        self._ended = False
        self._readers: set[asyncio.Event] = set()
        self._on_skipped = on_skipped
        self._texts: OrderedDict[tuple[str, int], str] = OrderedDict()

    @property
    def ended(self) -> bool:
        return self._ended

    def end(self) -> None:
        """End all streams; call it from the event loop."""
        self._ended = True
        for changed in self._readers:
            changed.set()

    def text(self, mission_id: str, event: Event) -> str:
        """The event as JSON, written once for all who read it: a plan's candidates take their time."""
        number = event.get("sequence")
        if number is None:
            return json.dumps(event, allow_nan=False)
        key = (mission_id, number)
        known = self._texts.get(key)
        if known is None:
            known = self._texts[key] = json.dumps(event, allow_nan=False)
            if len(self._texts) > _TEXTS_KEPT:
                self._texts.popitem(last=False)
        return known

    async def pause(self, seconds: float) -> None:
        """Wait so long, or until streams end."""
        ended = asyncio.Event()
        self._readers.add(ended)
        try:
            if not self._ended:
                with anyio.move_on_after(seconds):
                    await ended.wait()
        finally:
            self._readers.discard(ended)

    async def follow(
        self, mission: Mission, cursor: int, *, allowed: Callable[[], bool]
    ) -> AsyncGenerator[dict[str, Any]]:
        """Events after number `cursor` as they come, until the service ends or the reader may no longer.

        A reader that cannot keep up misses telemetry, never a change of state: it is given what is new when
        it asks again, and nothing is kept for it. `{"kind": "alive"}` has no sequence number.
        """
        loop = asyncio.get_running_loop()
        changed = asyncio.Event()

        def wake() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has closed: nobody is left to wake
                loop.call_soon_threadsafe(changed.set)

        log = await run_in_threadpool(lambda: mission.log)
        up_to_date = False
        self._readers.add(changed)
        log.add_waker(wake)
        try:
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
        finally:
            log.remove_waker(wake)
            self._readers.discard(changed)
