"""Presets that operators saved."""

from __future__ import annotations

from sqlmodel import col, select

from app.storage.database import Database
from app.storage.tables import PresetRecord, PresetRow


class PresetStore:
    def __init__(self, database: Database) -> None:
        self._database = database

    def save(self, record: PresetRecord) -> bool:
        """Add or replace; whether it is new."""
        with self._database.transaction() as session:
            is_new = session.get(PresetRow, record.name) is None
            session.merge(PresetRow(**record.model_dump()))
            return is_new

    def find(self, name: str) -> PresetRecord | None:
        with self._database.transaction() as session:
            row = session.get(PresetRow, name)
            return PresetRecord.model_validate(row.model_dump()) if row is not None else None

    def all(self) -> list[PresetRecord]:
        """By name."""
        with self._database.transaction() as session:
            rows = session.exec(select(PresetRow).order_by(col(PresetRow.name))).all()
            return [PresetRecord.model_validate(row.model_dump()) for row in rows]

    def delete(self, name: str) -> bool:
        """Whether it was there."""
        with self._database.transaction() as session:
            row = session.get(PresetRow, name)
            if row is not None:
                session.delete(row)
            return row is not None
