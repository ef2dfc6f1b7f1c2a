"""How readers of live events learn that there are more: one call into the event loop for all of them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator

from app.missions.event_log import EventLog


class Wakes:
    """Readers by the log that they follow. To be used from the event loop alone."""

    def __init__(self) -> None:
        self._followed: dict[EventLog, _Followed] = {}

    def n_readers(self, log: EventLog) -> int:
        followed = self._followed.get(log)
        return len(followed.readers) if followed is not None else 0

    @contextlib.contextmanager
    def reader(self, log: EventLog) -> Iterator[asyncio.Event]:
        """An event that is set whenever the log has grown; the reader clears it before it looks."""
        followed = self._followed.get(log)
        if followed is None:
            followed = self._followed[log] = _Followed(asyncio.get_running_loop())
            log.add_waker(followed.wake)
        changed = asyncio.Event()
        followed.readers.add(changed)
        try:
            yield changed
        finally:
            followed.readers.discard(changed)
            if not followed.readers:
                log.remove_waker(followed.wake)
                del self._followed[log]

    def wake_all(self) -> None:
        for followed in self._followed.values():
            followed.tell()


class _Followed:
    """One log's readers."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.readers: set[asyncio.Event] = set()
        self._loop = loop
        self._on_its_way = False

    def wake(self) -> None:
        """From the thread that wrote. What is written until the loop gets to it is told by the same call."""
        if self._on_its_way:
            return
        self._on_its_way = True
        with contextlib.suppress(RuntimeError):  # the loop has closed: nobody is left to wake
            self._loop.call_soon_threadsafe(self.tell)

    def tell(self) -> None:
        self._on_its_way = False
        for changed in self.readers:
            changed.set()
