"""Who tried to change what, and what came of it."""

from __future__ import annotations

from typing import Final

from sqlmodel import col, delete, select

from app.storage.database import Database
from app.storage.tables import AuditRecord, AuditRow

KEPT: Final = 200_000
"""Entries that are kept at least; older ones are let go, so that refused requests cannot fill the disk."""
_SWEEP: Final = 1_000


class AuditStore:
    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, record: AuditRecord) -> None:
        with self._database.transaction() as session:
            row = AuditRow(**record.model_dump())
            session.add(row)
            session.flush()
            assert row.id is not None
            if row.id % _SWEEP == 0:
                session.exec(delete(AuditRow).where(col(AuditRow.id) <= row.id - KEPT))

    def page(self, limit: int, *, before: int | None = None) -> list[AuditRecord]:
        """Up to `limit` entries, newest first; `before`: id of the last one already seen."""
        statement = select(AuditRow).order_by(col(AuditRow.id).desc()).limit(limit)
        if before is not None:
            statement = statement.where(col(AuditRow.id) < before)
        with self._database.transaction() as session:
            return [AuditRecord.model_validate(row.model_dump()) for row in session.exec(statement).all()]
