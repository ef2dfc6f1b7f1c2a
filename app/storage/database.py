"""The database: SQLite in the data folder, or PostgreSQL where `HGS_DATABASE_URL` says so.

The schema is brought up to date by Alembic when the service starts: records outlive versions of the
service, so a changed table needs a stated, ordered step from the old shape to the new one, which
`create_all` cannot give.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from alembic import command
from alembic.config import Config
from alembic.util.exc import CommandError
from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, IntegrityError, NoSuchModuleError, SQLAlchemyError
from sqlmodel import Session

from app.errors import Unavailable
from hgs_core.errors import ConfigError

log = logging.getLogger(__name__)

MIGRATIONS: Final = Path(__file__).parent / "migrations"
_BUSY_MS: Final = 10_000
_CLAIM_S: Final = 3.0
"""How long to wait for the lock of a service that has just ended: its server notices a little later [s]."""
_SERVICE_LOCK: Final = 0x68677301
"""Number of the advisory lock that one service holds on a PostgreSQL database."""


class StorageError(Unavailable):
    """The database did not do what it was asked: gone, full, or locked for too long."""


class Database:
    """Safe to use from any thread."""

    def __init__(self, url: str, *, on_error: Callable[[], None] = lambda: None) -> None:
        """`url` as SQLAlchemy takes it. `on_error` is called for every transaction that fails.

        Raises `ConfigError` for a database that cannot be used.
        """
        try:
            parsed = make_url(url)
        except ArgumentError as error:
            raise ConfigError(
                f"the database URL is not one: {error}; expected sqlite:////PATH or postgresql://USER@HOST/NAME"
            ) from error
        if parsed.drivername in ("postgresql", "postgres"):
            parsed = parsed.set(drivername="postgresql+psycopg")
        if parsed.get_backend_name() not in ("sqlite", "postgresql"):
            raise ConfigError(
                f"databases of kind {parsed.get_backend_name()!r} are not supported: use sqlite or postgresql"
            )
        self.label = parsed.render_as_string(hide_password=True)
        try:
            # A server may have gone since the last transaction; a file has not.
            remote = parsed.get_backend_name() != "sqlite"
            self._engine = create_engine(parsed, pool_pre_ping=remote)
        except (ModuleNotFoundError, NoSuchModuleError) as error:
            raise ConfigError(
                f"{self.label} needs a driver: pip install 'hgs[postgres]' ({error})"
            ) from error
        self._is_sqlite = parsed.get_backend_name() == "sqlite"
        self._claim: Connection | None = None
        self._on_error = on_error
        if self._is_sqlite:
            event.listen(self._engine, "connect", _prepare_sqlite)

    @property
    def engine(self) -> Engine:
        return self._engine

    def open(self) -> None:
        """Claim the database for this service and bring its schema up to date.

        Raises `ConfigError` when it cannot be reached, another service uses it, or it is of a newer version.
        """
        try:
            self._claim_it()
            with self._engine.begin() as connection:
                config = Config()
                config.set_main_option("script_location", str(MIGRATIONS))
                config.attributes["connection"] = connection
                command.upgrade(config, "head")
        except CommandError as error:
            raise ConfigError(
                f"{self.label} was written by a newer version of hgs ({error}): use that, or another database"
            ) from error
        except SQLAlchemyError as error:
            raise ConfigError(f"{self.label} cannot be used: {_first_line(error)}") from error

    def close(self) -> None:
        if self._claim is not None:
            self._claim.close()
            self._claim = None
        self._engine.dispose()

    @contextmanager
    def transaction(self) -> Iterator[Session]:
        """All of it happens, or nothing. Raises `StorageError`; `IntegrityError` passes, callers know why."""
        try:
            with Session(self._engine, expire_on_commit=False) as session, session.begin():
                yield session
        except IntegrityError:
            raise
        except DBAPIError as error:
            self._on_error()
            raise StorageError(f"the database did not answer as it should: {_first_line(error)}") from error

    def check(self) -> None:
        """Raises `StorageError` when it does not answer, or cannot be written."""
        with self.transaction() as session:
            connection = session.connection()
            if self._is_sqlite:
                # The write lock, taken and let go: refused by a database that may only be read.
                connection.exec_driver_sql("BEGIN IMMEDIATE")
                connection.exec_driver_sql("ROLLBACK")
            elif connection.execute(text("SHOW transaction_read_only")).scalar() == "on":
                raise StorageError("the database can only be read: it is a standby, or set to that")

    def _claim_it(self) -> None:
        """Two services on one database would each call the other's missions lost. SQLite lies in the data
        folder, which has a lock of its own (`app.storage.data_dir`)."""
        if self._is_sqlite:
            return
        self._claim = self._engine.connect().execution_options(isolation_level="AUTOCOMMIT")
        deadline = time.monotonic() + _CLAIM_S
        while not self._claim.execute(text(f"SELECT pg_try_advisory_lock({_SERVICE_LOCK})")).scalar():
            if time.monotonic() < deadline:
                time.sleep(0.1)
                continue
            self.close()
            raise ConfigError(
                f"{self.label} is in use by another hgs service: end it, or name another database"
            )


def _prepare_sqlite(connection: Any, _: Any) -> None:
    """Write-ahead log: readers never wait for the writer, and a killed process leaves nothing half done."""
    cursor = connection.cursor()
    for pragma in ("journal_mode=WAL", "synchronous=NORMAL", "foreign_keys=ON", f"busy_timeout={_BUSY_MS}"):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _first_line(error: SQLAlchemyError) -> str:
    cause = getattr(error, "orig", None) or error
    return str(cause).strip().splitlines()[0] if str(cause).strip() else type(cause).__name__
