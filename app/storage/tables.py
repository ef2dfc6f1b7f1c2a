"""The tables. Times are Unix time [s]; migrations (`migrations/versions`) bring a database to this shape.

A record class says what is known; the table class of the same name adds only how it lies in SQL.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Any

from sqlalchemy import JSON, BigInteger, Column, Integer, String, TypeDecorator, UniqueConstraint
from sqlmodel import Field, SQLModel

from app.missions.states import MissionState
from hgs_core.mission.clock import ClockKind


class _StateText(TypeDecorator[MissionState]):
    """A state as its word; no SQL enum, which would need a migration for every new state."""

    impl = String(16)
    cache_ok = True

    def process_bind_param(self, value: MissionState | None, dialect: Any) -> str | None:
        return None if value is None else str(value)

    def process_result_value(self, value: Any, dialect: Any) -> MissionState | None:
        return None if value is None else MissionState(value)


class _ClockText(TypeDecorator[ClockKind]):
    """A clock as its word."""

    impl = String(16)
    cache_ok = True

    def process_bind_param(self, value: ClockKind | None, dialect: Any) -> str | None:
        return None if value is None else str(value)

    def process_result_value(self, value: Any, dialect: Any) -> ClockKind | None:
        return None if value is None else ClockKind(value)


class FilesKept(StrEnum):
    """Which of a finished mission's files are left."""

    ALL = "all"
    LIGHT = "light"
    """Reports and logs (`app.storage.space.LIGHT`)."""
    NONE = "none"


class _FilesText(TypeDecorator[FilesKept]):
    """As its word."""

    impl = String(16)
    cache_ok = True

    def process_bind_param(self, value: FilesKept | None, dialect: Any) -> str | None:
        return None if value is None else str(value)

    def process_result_value(self, value: Any, dialect: Any) -> FilesKept | None:
        return None if value is None else FilesKept(value)


class MissionRecord(SQLModel):
    """What is known of a mission once and for all, and how far it got."""

    id: str = Field(primary_key=True, max_length=64)
    scene: str = Field(max_length=200)
    """As chosen: a built-in name or a listed file's name."""
    scene_source: str
    """As run: a built-in name or a path."""
    preset: str = Field(max_length=100)
    """As chosen: a built-in preset or one that an operator saved."""
    preset_source: str = Field(max_length=100)
    """As run: the built-in preset below it."""
    seed: int
    max_time_s: float | None
    clock: ClockKind | None = Field(default=None, sa_type=_ClockText)
    """None = the preset's."""
    extends: str | None = Field(default=None, max_length=64)
    """The mission whose maps it begins with."""
    overrides: dict[str, str] = Field(sa_type=JSON)
    """As run: the saved preset's, then the mission's own."""
    idempotency_key: str | None = Field(max_length=200)
    request_digest: str | None = Field(max_length=64)
    """SHA-256 of the request that the key stands for."""
    created_by: str = Field(max_length=100)
    """Name of the token that created it."""
    created_at: float = Field(index=True)
    queued_at: float | None = None
    started_at: float | None = None
    ended_at: float | None = None
    state: MissionState = Field(default=MissionState.CREATED, sa_type=_StateText, index=True)
    reason: str = "waiting for start"
    """Why it is in this state, in words."""
    stop_reason: str | None = Field(default=None, max_length=50)
    """The mission's own word for why it ended (`complete`, `interrupted`, ...)."""
    view_sequence: int = 0
    """Number of the last view, which is kept; 0 = none."""
    pinned: bool = False
    """Its files stay, whatever room others need."""
    files: FilesKept = Field(default=FilesKept.ALL, sa_type=_FilesText)


class MissionRow(MissionRecord, table=True):
    __tablename__ = "mission"
    __table_args__ = (UniqueConstraint("idempotency_key", name="mission_idempotency_key"),)


class EventRow(SQLModel, table=True):
    """One event of a mission."""

    __tablename__ = "event"

    mission_id: str = Field(primary_key=True, foreign_key="mission.id", ondelete="CASCADE", max_length=64)
    sequence: int = Field(primary_key=True)
    """1, 2, ... within the mission."""
    kind: str = Field(max_length=50)
    content: dict[str, Any] = Field(sa_type=JSON)
    """The whole event as the API gives it."""


class PresetRecord(SQLModel):
    """A preset that an operator saved: a built-in one with settings that differ."""

    name: str = Field(primary_key=True, max_length=100)
    base: str = Field(max_length=100)
    description: str = Field(max_length=500)
    overrides: dict[str, str] = Field(sa_type=JSON)
    saved_by: str = Field(max_length=100)
    saved_at: float


class PresetRow(PresetRecord, table=True):
    __tablename__ = "preset"


class AuditRecord(SQLModel):
    """One attempt to change something, and what came of it."""

    id: int | None = Field(
        default=None,
        sa_column=Column(BigInteger().with_variant(Integer(), "sqlite"), primary_key=True),
    )
    at: float = Field(index=True)
    actor: str = Field(max_length=100)
    """Name of the token; `anyone` where no token is set, `unknown` where none was recognised."""
    role: str = Field(max_length=16)
    address: str = Field(max_length=64)
    method: str = Field(max_length=16)
    path: str = Field(max_length=300)
    status: int
    """The HTTP status of the answer; 4xx: nothing was changed."""


class AuditRow(AuditRecord, table=True):
    __tablename__ = "audit"


class LoginRow(SQLModel, table=True):
    """A browser's session. Neither its secret nor the token is kept, only their SHA-256."""

    __tablename__ = "login"

    secret_digest: str = Field(primary_key=True, max_length=64)
    token_digest: str = Field(max_length=64)
    opened_at: float
    expires_at: float
