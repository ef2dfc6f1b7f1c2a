"""Sessions of browsers, so that a restart of the service logs nobody out."""

from __future__ import annotations

from sqlmodel import col, delete, select

from app.storage.database import Database
from app.storage.tables import LoginRow


class LoginStore:
    def __init__(self, database: Database) -> None:
        self._database = database

    def add(self, row: LoginRow, *, now: float) -> None:
        """Add `row`, and forget those that expired before `now`."""
        with self._database.transaction() as session:
            session.exec(delete(LoginRow).where(col(LoginRow.expires_at) <= now))
            session.add(row)

    def delete(self, secret_digest: str) -> None:
        with self._database.transaction() as session:
            session.exec(delete(LoginRow).where(col(LoginRow.secret_digest) == secret_digest))

    def all(self) -> list[LoginRow]:
        with self._database.transaction() as session:
            return list(session.exec(select(LoginRow)).all())
