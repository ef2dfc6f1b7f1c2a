"""Missions and their events. A change of state and the event that tells it are one transaction."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from sqlalchemy import func, insert, tuple_
from sqlalchemy.exc import IntegrityError
from sqlmodel import col, select

from app.errors import Conflict
from app.missions.states import MissionState
from app.storage.database import Database
from app.storage.tables import EventRow, FilesKept, MissionRecord, MissionRow

Event = dict[str, Any]

_UNFINISHED = tuple(state for state in MissionState if not state.ended)


class MissionStore:
    """Rows in, records out; safe to use from any thread."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, record: MissionRecord) -> None:
        """Raises `Conflict` when another mission has the same id or Idempotency-Key."""
        try:
            with self._database.transaction() as session:
                session.add(MissionRow(**record.model_dump()))
        except IntegrityError as error:
            raise Conflict(f"mission {record.id} or its Idempotency-Key exists already") from error

    def save(self, events: Sequence[Event], record: MissionRecord | None, mission_id: str) -> None:
        """Add `events` of one mission, and replace its record where one is given."""
        with self._database.transaction() as session:
            if record is not None:
                session.merge(MissionRow(**record.model_dump()))
                session.flush()
            if events:
                rows = [
                    {"mission_id": mission_id, "sequence": e["sequence"], "kind": e["kind"], "content": e}
                    for e in events
                ]
                session.connection().execute(insert(EventRow), rows)

    def find(self, mission_id: str) -> MissionRecord | None:
        with self._database.transaction() as session:
            row = session.get(MissionRow, mission_id)
            return _record(row) if row is not None else None

    def find_by_key(self, key: str) -> MissionRecord | None:
        with self._database.transaction() as session:
            row = session.exec(select(MissionRow).where(MissionRow.idempotency_key == key)).first()
            return _record(row) if row is not None else None

    def unfinished(self) -> list[MissionRecord]:
        """Missions that have not ended, oldest first."""
        statement = select(MissionRow).where(col(MissionRow.state).in_(_UNFINISHED))
        with self._database.transaction() as session:
            rows = session.exec(statement.order_by(col(MissionRow.created_at), col(MissionRow.id))).all()
            return [_record(row) for row in rows]

    def count_by_state(self) -> dict[str, int]:
        statement = select(MissionRow.state, func.count()).group_by(col(MissionRow.state))
        with self._database.transaction() as session:
            return {str(state): number for state, number in session.exec(statement).all()}

    def removable(self, kept: FilesKept) -> list[MissionRecord]:
        """Missions that have ended, are not pinned, and have more files than `kept`; the oldest end first."""
        more = [FilesKept.ALL, FilesKept.LIGHT] if kept is FilesKept.NONE else [FilesKept.ALL]
        statement = select(MissionRow).where(
            col(MissionRow.state).not_in(_UNFINISHED),
            col(MissionRow.pinned).is_(False),
            col(MissionRow.files).in_(more),
        )
        with self._database.transaction() as session:
            rows = session.exec(statement.order_by(col(MissionRow.ended_at), col(MissionRow.id))).all()
            return [_record(row) for row in rows]

    def page(
        self,
        limit: int,
        *,
        before: tuple[float, str] | None = None,
        states: Collection[MissionState] | None = None,
    ) -> list[MissionRecord]:
        """Up to `limit` missions, newest first; `before`: creation time and id of the last one seen."""
        key = (col(MissionRow.created_at), col(MissionRow.id))
        statement = select(MissionRow).order_by(key[0].desc(), key[1].desc()).limit(limit)
        if before is not None:
            statement = statement.where(tuple_(*key) < tuple_(*before))
        if states is not None:
            statement = statement.where(col(MissionRow.state).in_(states))
        with self._database.transaction() as session:
            return [_record(row) for row in session.exec(statement).all()]

    def events(
        self,
        mission_id: str,
        *,
        after: int = 0,
        before: int | None = None,
        limit: int,
        kinds: Collection[str] | None = None,
        without: str | None = None,
        newest: bool = False,
    ) -> list[Event]:
        """The first (or the last) `limit` events above `after` and below `before`, in order; of `kinds`, not
        of `without`."""
        sequence = col(EventRow.sequence)
        statement = select(EventRow.content).where(EventRow.mission_id == mission_id, sequence > after)
        if before is not None:
            statement = statement.where(sequence < before)
        if kinds is not None:
            statement = statement.where(col(EventRow.kind).in_(kinds))
        if without is not None:
            statement = statement.where(col(EventRow.kind) != without)
        statement = statement.order_by(sequence.desc() if newest else sequence).limit(limit)
        with self._database.transaction() as session:
            found = [dict(content) for content in session.exec(statement).all()]
        return found[::-1] if newest else found

    def columns(
        self, mission_id: str, kind: str, names: Sequence[str], *, after: int, before: int, limit: int
    ) -> list[tuple[float | None, ...]]:
        """The last `limit` events of `kind` above `after` and below `before`, in order: number, then the
        numbers called `names`.

        Only these leave the database: a plan with all its candidates has a hundred times as much.
        """
        sequence = col(EventRow.sequence)
        numbers = [col(EventRow.content)[name].as_float() for name in names]
        statement = (
            select(EventRow.sequence, *numbers)
            .where(EventRow.mission_id == mission_id, EventRow.kind == kind)
            .where(sequence > after, sequence < before)
            .order_by(sequence.desc())
            .limit(limit)
        )
        with self._database.transaction() as session:
            return [tuple(row) for row in session.exec(statement).all()][::-1]

    def last_sequence(self, mission_id: str) -> int:
        """Number of the newest event; 0 = none."""
        statement = select(func.max(EventRow.sequence)).where(EventRow.mission_id == mission_id)
        with self._database.transaction() as session:
            return session.exec(statement).one() or 0


def _record(row: MissionRow) -> MissionRecord:
    return MissionRecord.model_validate(row.model_dump())
