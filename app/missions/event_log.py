"""A mission's events in order: the newest in memory, all of them in the database.

Readers keep nothing but a cursor (the sequence number they have seen), so a slow one costs no memory: when it
falls behind, it is given every state change and only the newest telemetry.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Final

from app.errors import Invalid
from app.storage.database import StorageError
from app.storage.missions import Event, MissionStore
from app.storage.tables import MissionRecord

log = logging.getLogger(__name__)

OTHERS_KEPT: Final = 256
LIVE_TELEMETRY: Final = 20
"""Telemetry events that one read hands out at most; older ones are skipped."""
STORED_PAGE: Final = 50
"""Events that one read from the database hands out at most: a reader far behind holds no more than these."""
BACKLOG: Final = 2_000
"""Events that wait in memory while the database cannot be written; beyond that, telemetry is let go."""


class EventLog:
    """Append-only; safe to use from any thread. Reading what is in memory never waits for the database."""

    def __init__(self, store: MissionStore, mission_id: str) -> None:
        self._store = store
        self._mission_id = mission_id
        self._writing = threading.Lock()
        self._lock = threading.Lock()
        self._last = store.last_sequence(mission_id)
        self._telemetry: deque[Event] = deque(maxlen=LIVE_TELEMETRY)
        self._others: deque[Event] = deque(maxlen=OTHERS_KEPT)
        self._complete_after = self._last
        """Every event above this number that is not telemetry is in `_others`."""
        self._newest: dict[str, Event | None] = {}
        """Of each kind that was told here or asked for; None = the database has none."""
        self._told_nothing = self._last == 0
        """Nothing was told before this log was opened: what is not in memory does not exist."""
        self._unsaved: list[Event] = []
        self._unsaved_record: MissionRecord | None = None
        self._wakers: set[Callable[[], None]] = set()

    @property
    def last_sequence(self) -> int:
        return self._last

    @property
    def n_unsaved(self) -> int:
        """Events that the database has not taken yet."""
        return len(self._unsaved)

    def append(
        self,
        event: Event,
        record: MissionRecord | None = None,
        *,
        saved: Callable[[], None] = lambda: None,
    ) -> Event:
        """Number `event`, save it (and `record`, in the same transaction), call `saved`, wake the readers.

        Returns it with its `sequence`. A database that cannot be written holds no robot up: the event is told
        all the same and saved with the next one that can be.
        """
        with self._writing:
            numbered = {"sequence": self._last + 1, **event}
            self._unsaved.append(numbered)
            self._unsaved_record = record if record is not None else self._unsaved_record
            self._save()
            saved()
            with self._lock:
                self._remember(numbered)
                wakers = tuple(self._wakers)
        for wake in wakers:
            wake()
        return numbered

    def live(self, after: int) -> list[Event] | None:
        """What a live reader at `after` gets next: all that is not telemetry, and the newest telemetry.

        None when it is so far behind that memory does not hold it all: ask `catch_up` then.
        """
        with self._lock:
            if after < self._complete_after:
                return None
            return sorted([*_newer(self._others, after), *_newer(self._telemetry, after)], key=_sequence)

    def catch_up(self, after: int) -> list[Event]:
        """As `live`, from the database, a page at a time; it may take a while."""
        others = self._store.events(self._mission_id, after=after, limit=STORED_PAGE, without="telemetry")
        if len(others) == STORED_PAGE:
            return others
        telemetry = self._store.events(
            self._mission_id, after=after, limit=LIVE_TELEMETRY, kinds=["telemetry"], newest=True
        )
        return sorted([*others, *telemetry], key=_sequence)

    def history(
        self,
        *,
        after: int = 0,
        before: int | None = None,
        limit: int = 500,
        kinds: Collection[str] | None = None,
        newest: bool = False,
    ) -> tuple[list[Event], bool]:
        """The first (or the last) `limit` events of these kinds above `after` and below `before`, and whether
        there are more."""
        if limit < 1:
            raise Invalid(f"limit is {limit}, expected at least 1")
        found = self._store.events(
            self._mission_id, after=after, before=before, limit=limit + 1, kinds=kinds, newest=newest
        )
        more = len(found) > limit
        if more:
            found = found[1:] if newest else found[:limit]
        return found, more

    def columns(
        self, kind: str, names: Sequence[str], *, after: int, before: int, limit: int
    ) -> list[tuple[float | None, ...]]:
        """See `MissionStore.columns`."""
        return self._store.columns(self._mission_id, kind, names, after=after, before=before, limit=limit)

    def newest_at(self, kind: str, sequence: int) -> Event | None:
        """The newest event of `kind` when `sequence` was the newest number."""
        found = self._store.events(self._mission_id, before=sequence + 1, limit=1, kinds=[kind], newest=True)
        return found[0] if found else None

    def told_since(self, time_s: float) -> list[Event]:
        """What was told of this mission time and later ones, and is saved or waits to be."""
        found: list[Event] = []
        page, more = self.history(limit=STORED_PAGE, newest=True)
        while page:
            found = [event for event in page if event.get("time_s", -1.0) >= time_s] + found
            if not more or any(0.0 <= event.get("time_s", -1.0) < time_s for event in page):
                break
            page, more = self.history(before=page[0]["sequence"], limit=STORED_PAGE, newest=True)
        with self._writing:
            return found + [event for event in self._unsaved if event.get("time_s", -1.0) >= time_s]

    def newest(self, kind: str) -> Event | None:
        """Waits for the database once at most, where an earlier service may have told it: see `knows`."""
        if self.knows(kind):
            return self._newest.get(kind)
        found = self._store.events(self._mission_id, limit=1, kinds=[kind], newest=True)
        with self._lock:  # what was told meanwhile is newer
            return self._newest.setdefault(kind, found[0] if found else None)

    def knows(self, kind: str) -> bool:
        """Whether `newest` of that kind is in memory."""
        return self._told_nothing or kind in self._newest

    def add_waker(self, wake: Callable[[], None]) -> None:
        """Call `wake` after every append, from the appending thread, until `remove_waker`."""
        with self._lock:
            self._wakers.add(wake)

    def remove_waker(self, wake: Callable[[], None]) -> None:
        with self._lock:
            self._wakers.discard(wake)

    def _save(self) -> None:
        try:
            self._store.save(self._unsaved, self._unsaved_record, self._mission_id)
        except StorageError as error:
            waiting = len(self._unsaved)
            log.error("%d events wait to be saved: %s", waiting, error, extra={"mission": self._mission_id})
            if len(self._unsaved) > BACKLOG:
                self._unsaved = [event for event in self._unsaved if not _is_telemetry(event)]
        else:
            self._unsaved.clear()
            self._unsaved_record = None

    def _remember(self, event: Event) -> None:
        self._last = event["sequence"]
        self._newest[event["kind"]] = event
        if _is_telemetry(event):
            self._telemetry.append(event)
            return
        if len(self._others) == OTHERS_KEPT:
            self._complete_after = self._others[0]["sequence"]
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
