"""Mission records on disk: one `mission.json` a mission, written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from app.missions.states import MissionState
from hgs_core.config.base import StrictConfig
from hgs_core.errors import ConfigError
from hgs_core.mission.clock import ClockKind


class MissionRecord(StrictConfig):
    """What is known of a mission once and for all, and how far it got."""

    id: str
    scene: str
    """As chosen: a built-in name or a listed file's name."""
    scene_source: str
    """As run: a built-in name or a path."""
    preset: str
    seed: int
    max_time_s: float | None
    clock: ClockKind | None = None
    """None = the preset's."""
    overrides: dict[str, str]
    idempotency_key: str | None
    created_at: float
    """Unix time [s]."""
    started_at: float | None = None
    ended_at: float | None = None
    state: MissionState = MissionState.CREATED
    reason: str = "waiting for start"
    """Why it is in this state, in words."""
    stop_reason: str | None = None
    """The mission's own word for why it ended (`complete`, `interrupted`, ...)."""
    view_sequence: int = 0
    """Number of the last view, whose images are kept; 0 = none."""


class MissionStore:
    """Records under `root/ID/mission.json`; a mission's other files lie beside them."""

    def __init__(self, root: Path) -> None:
        self._root = root
        root.mkdir(parents=True, exist_ok=True)

    def folder(self, mission_id: str) -> Path:
        return self._root / mission_id

    def save(self, record: MissionRecord) -> None:
        folder = self.folder(record.id)
        folder.mkdir(parents=True, exist_ok=True)
        temporary = folder / "mission.json.partial"
        with temporary.open("w", encoding="utf-8") as file:
            file.write(record.model_dump_json(indent=2))
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(folder / "mission.json")

    def load_all(self) -> Iterator[MissionRecord]:
        """Every record, oldest first. Raises `ConfigError` naming a file that cannot be read."""
        records: list[MissionRecord] = []
        for path in sorted(self._root.glob("*/mission.json")):
            try:
                records.append(MissionRecord.model_validate(json.loads(path.read_text(encoding="utf-8"))))
            except (ValidationError, json.JSONDecodeError) as error:
                raise ConfigError(
                    f"{path} is not a mission record; move it away to go on: {error}"
                ) from error
        yield from sorted(records, key=lambda record: (record.created_at, record.id))
