"""Room for missions: the oldest finished ones give up their files first, the large ones before the reports,
and none begins where it would find no room.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from pydantic import ByteSize

from app.errors import NoRoom
from app.missions.service import MissionService
from app.settings import RetentionSettings
from app.storage.audit import AuditStore
from app.storage.database import StorageError
from app.storage.missions import MissionStore
from app.storage.space import LIGHT, Space
from app.storage.tables import AuditRecord, FilesKept, MissionRecord

log = logging.getLogger(__name__)

ACTOR = "retention"
"""Its name in the audit."""
_DAY_S = 86_400.0


class Retention:
    """Looks after the data folder from a thread of its own, and whenever a mission is about to begin.

    Missions that have not ended, and pinned ones, are never touched. That files go is written down (in the
    mission's record and events, and in the audit) before they go; these entries stay.
    """

    def __init__(
        self,
        settings: RetentionSettings,
        service: MissionService,
        store: MissionStore,
        audit: AuditStore,
        space: Space,
        *,
        on_removed: Callable[[int], None] = lambda _: None,
    ) -> None:
        self._settings = settings
        self._service = service
        self._store = store
        self._audit = audit
        self._space = space
        self._on_removed = on_removed
        self._sweeping = threading.Lock()
        self._wake = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="retention", daemon=True)

    def begin(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._ended = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join(5.0)

    def look_soon(self) -> None:
        """A mission has ended: there may be something to do."""
        self._wake.set()

    def make_room(self) -> None:
        """Raises `NoRoom` when a new mission would not find the room it needs, whatever may be removed."""
        self.sweep()
        lacking = self._lacking_bytes()
        if lacking > 0:
            raise NoRoom(self._refusal(lacking))

    def sweep(self) -> None:
        """Remove what the settings let go."""
        with self._sweeping:
            self._space.measure(changing={mission.id for mission in self._service.unfinished()})
            for record, why in self._outdated():
                self._give_up(record, FilesKept.LIGHT, why)
            for kept in (FilesKept.LIGHT, FilesKept.NONE):
                if self._lacking_bytes() <= 0:
                    return
                for record in self._store.removable(kept):
                    self._give_up(record, kept, "to make room for others")
                    if self._lacking_bytes() <= 0:
                        return

    def finish_removals(self) -> None:
        """Remove what was to go already when an earlier service ended."""
        with self._sweeping:
            for mission_id in self._space.measure(changing=()):
                record = self._store.find(mission_id)
                if record is not None and record.files is not FilesKept.ALL:
                    self._space.remove(mission_id, keep=_names(record.files))

    def _run(self) -> None:
        look: Callable[[], None] = self.finish_removals
        while not self._ended:
            try:
                look()
                look = self.sweep
            except (StorageError, OSError) as error:
                log.warning("room could not be looked after: %s", error)
            except Exception:
                log.exception("room could not be looked after")
            else:
                if look is self.finish_removals:
                    continue
            self._wake.wait(self._settings.interval_s)
            self._wake.clear()

    def _outdated(self) -> list[tuple[MissionRecord, str]]:
        """Missions whose large files go whether there is room or not, and why."""
        most, oldest_s = self._settings.keep_missions, self._settings.max_age_s
        found = []
        records = self._store.removable(FilesKept.LIGHT)
        surplus = 0 if most is None else len(records) - most
        for position, record in enumerate(records):
            age_s = time.time() - (record.ended_at or record.created_at)
            if position < surplus:
                found.append((record, f"only the newest {most} keep theirs"))
            elif oldest_s is not None and age_s > oldest_s:
                found.append((record, f"it ended {age_s / _DAY_S:.1f} days ago"))
        return found

    def _lacking_bytes(self) -> int:
        """So much more would have to be free for a new mission."""
        room = self._settings.room_bytes
        lacking = room - self._space.disk().free
        if self._settings.max_bytes is not None:
            lacking = max(lacking, self._space.used_bytes + room - self._settings.max_bytes)
        return lacking

    def _give_up(self, record: MissionRecord, kept: FilesKept, why: str) -> None:
        self._service.get(record.id).note_removal(kept, why)
        freed = self._space.remove(record.id, keep=_names(kept))
        self._on_removed(freed)
        log.info(
            "files of a mission were removed: %s",
            why,
            extra={"mission": record.id, "freed_bytes": freed, "kept": str(kept)},
        )
        self._audit.add(
            AuditRecord(
                at=time.time(),
                actor=ACTOR,
                role="service",
                address="-",
                method="DELETE",
                path=f"/missions/{record.id}/files?keep={kept}",
                status=200,
            )
        )

    def _refusal(self, lacking: int) -> str:
        settings, space = self._settings, self._space
        quota = settings.max_bytes
        bounds = f"{_size(space.disk().free)} are free on the disk"
        if quota is not None:
            bounds += f", and missions hold {_size(space.used_bytes)} of the {_size(quota)} they may"
        return (
            f"a new mission needs {_size(settings.room_bytes)}: {bounds}; {_size(lacking)} more must be "
            "free. Unpin missions, wait until one ends, or give the service more room"
        )


def _names(kept: FilesKept) -> frozenset[str]:
    return LIGHT if kept is FilesKept.LIGHT else frozenset()


def _size(n_bytes: int) -> str:
    return ByteSize(n_bytes).human_readable(separator=" ")
