"""A mission's events in order: the newest in memory, all of them in a file.

Readers keep nothing but a cursor (the sequence number they have seen), so a slow one costs no memory: when it
falls behind, it is given every state change and only the newest telemetry.
"""

from __future__ import annotations

import json
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from app.errors import Invalid

log = logging.getLogger(__name__)

Event = dict[str, Any]

TELEMETRY_KEPT: Final = 20_000
OTHERS_KEPT: Final = 4_000
LIVE_TELEMETRY: Final = 20
"""Telemetry events that one read hands out at most; older ones are skipped."""


class EventLog:
    """Append-only; safe to use from any thread. `path` holds one JSON event a line."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._telemetry: deque[Event] = deque(maxlen=TELEMETRY_KEPT)
        self._others: deque[Event] = deque(maxlen=OTHERS_KEPT)
        self._others_forgotten = 0
        self._last = 0
        self._wakers: set[Callable[[], None]] = set()
        _cut_off_unfinished_line(path)
        for event in _read_lines(path):
            self._remember(event)
        self._file = path.open("a", encoding="utf-8", buffering=1)

    @property
    def last_sequence(self) -> int:
        return self._last

    def append(self, event: Event) -> Event:
        """Number `event`, write it down, and wake the readers. Returns it with its `sequence`."""
        with self._lock:
            numbered = {"sequence": self._last + 1, **event}
            self._remember(numbered)
            if not self._file.closed:
                self._file.write(json.dumps(numbered, allow_nan=False) + "\n")
            wakers = tuple(self._wakers)
        for wake in wakers:
            wake()
        return numbered

    def live(self, after: int) -> list[Event]:
        """What a live reader at `after` gets next: all that is not telemetry, and the newest telemetry."""
        with self._lock:
            others = _newer(self._others, after)
            telemetry = _newer(self._telemetry, after)[-LIVE_TELEMETRY:]
            forgotten = self._others_forgotten
        if after < forgotten:
            others = [e for e in _read_lines(self._path) if e["sequence"] > after and not _is_telemetry(e)]
        return sorted([*others, *telemetry], key=_sequence)

    def history(
        self, *, after: int = 0, limit: int = 500, kinds: Iterable[str] | None = None
    ) -> tuple[list[Event], bool]:
        """The first `limit` events above `after` of the given kinds, and whether there are more."""
        wanted = None if kinds is None else frozenset(kinds)
        if limit < 1:
            raise Invalid(f"limit is {limit}, expected at least 1")
        with self._lock:
            complete = self._others_forgotten <= after and (
                len(self._telemetry) < TELEMETRY_KEPT or _sequence(self._telemetry[0]) <= after + 1
            )
            found: Iterable[Event] = (
                sorted([*_newer(self._others, after), *_newer(self._telemetry, after)], key=_sequence)
                if complete
                else ()
            )
        if not complete:
            found = (event for event in _read_lines(self._path) if event["sequence"] > after)
        page: list[Event] = []
        for event in found:
            if wanted is None or event["kind"] in wanted:
                if len(page) == limit:
                    return page, True
                page.append(event)
        return page, False

    def newest_of(self, kinds: Iterable[str] | None, limit: int) -> tuple[list[Event], bool]:
        """The last `limit` events of these kinds in memory, in order, and whether there are older ones."""
        wanted = None if kinds is None else frozenset(kinds)
        with self._lock:
            pools = (self._others, self._telemetry)
            found = sorted(
                (e for pool in pools for e in pool if wanted is None or e["kind"] in wanted), key=_sequence
            )
            forgotten = self._others_forgotten > 0
        return found[-limit:], len(found) > limit or forgotten

    def telemetry(self, *, after: int = 0) -> list[Event]:
        """Telemetry in memory above `after`."""
        with self._lock:
            return _newer(self._telemetry, after)

    def newest(self, kind: str) -> Event | None:
        with self._lock:
            events = self._telemetry if kind == "telemetry" else self._others
            return next((event for event in reversed(events) if event["kind"] == kind), None)

    def add_waker(self, wake: Callable[[], None]) -> None:
        """Call `wake` after every append, from the appending thread, until `remove_waker`."""
        with self._lock:
            self._wakers.add(wake)

    def remove_waker(self, wake: Callable[[], None]) -> None:
        with self._lock:
            self._wakers.discard(wake)

    def close(self) -> None:
        """Close the file; what is in memory stays readable."""
        with self._lock:
            self._file.close()

    def _remember(self, event: Event) -> None:
        self._last = event["sequence"]
        if _is_telemetry(event):
            self._telemetry.append(event)
            return
        if len(self._others) == OTHERS_KEPT:
            self._others_forgotten = self._others[0]["sequence"]
        self._others.append(event)


def _is_telemetry(event: Event) -> bool:
    return bool(event["kind"] == "telemetry")


def _sequence(event: Event) -> int:
    return int(event["sequence"])


def _newer(events: deque[Event], after: int) -> list[Event]:
    """Those above `after`, found from the new end, because readers are mostly up to date."""
    found: list[Event] = []
    for event in reversed(events):
        if event["sequence"] <= after:
            break
        found.append(event)
    found.reverse()
    return found


def _read_lines(path: Path) -> Iterator[Event]:
    """Events in the file; a last line that is being written is left out."""
    if not path.is_file():
        return
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            if line.endswith("\n"):
                yield json.loads(line)


def _cut_off_unfinished_line(path: Path) -> None:
    """Remove what a crash left of a line, so that the next event begins on a line of its own."""
    if not path.is_file():
        return
    with path.open("rb+") as file:
        content = file.read()
        whole = content.rfind(b"\n") + 1
        if whole != len(content):
            log.warning("%s: dropped an event that a crash cut off", path)
            file.truncate(whole)
