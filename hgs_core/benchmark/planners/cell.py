"""One mission of the grid: where it lies, under which conditions it ran, and what became of it."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from hgs_core.benchmark.planners.fingerprint import Fingerprint
from hgs_core.config.base import StrictConfig
from hgs_core.errors import ConfigError
from hgs_core.mission.events import StopReason

CELLS: Final = "cells"


class CellStatus(StrEnum):
    FINISHED = "finished"
    """The mission ended by itself or by a limit, and was evaluated."""
    FAILED = "failed"
    """It could not begin, or broke off; the next call tries again."""
    UNFINISHED = "unfinished"
    """Not run yet, or killed on its way."""


class CellKey(StrictConfig):
    """Which mission."""

    planner: str
    """Planner preset."""
    scene: str
    """Name of the scene, as its report states it."""
    seed: int

    def __str__(self) -> str:
        return f"{self.scene}, {self.planner}, seed {self.seed}"

    @property
    def file_name(self) -> str:
        """Of files about this cell: `SCENE-PLANNER-SEED`."""
        return f"{scene_file_name(self.scene)}-{self.planner}-{self.seed}"


class CellRecord(StrictConfig):
    """What stands beside a cell's folder from its beginning."""

    fingerprint: Fingerprint
    commit: str
    """Of the checkout that ran it; the version where there is none. Stated, not compared."""
    engine: str
    cells_at_once: int
    """How many ran beside each other at most: planning times depend on it."""
    lower_m: tuple[float, float]
    """Corner of the scene's bounds in x and y, for pictures to the same scale."""
    upper_m: tuple[float, float]
    processor: str | None = None
    """Of the machine that it ran on; None until it ended there."""
    failure: str | None = None


@dataclass(frozen=True, kw_only=True)
class CellResult:
    """What is known of a cell, read from its files alone."""

    key: CellKey
    status: CellStatus
    message: str
    """Why it failed or how the mission ended."""
    record: CellRecord | None
    report: Mapping[str, Any] | None
    """`report.json` of a mission that ended; None unless the status is `finished`."""


@dataclass(frozen=True)
class CellFiles:
    """The paths of one cell under the grid's folder `root`."""

    root: Path
    key: CellKey

    @property
    def folder(self) -> Path:
        """The run's folder, whole or not there (`run_mission` renames it in the end)."""
        return self.root / CELLS / scene_file_name(self.key.scene) / f"{self.key.planner}-{self.key.seed}"

    @property
    def partial(self) -> Path:
        return self._beside(".partial")

    @property
    def record(self) -> Path:
        return self._beside(".json")

    @property
    def log(self) -> Path:
        """What the cell's process printed."""
        return self._beside(".log")

    def _beside(self, suffix: str) -> Path:
        return self.folder.with_name(self.folder.name + suffix)

    def write_record(self, record: CellRecord) -> None:
        self.record.parent.mkdir(parents=True, exist_ok=True)
        write_text(self.record, record.model_dump_json(indent=2) + "\n")

    def read(self) -> CellResult:
        """Raises `ConfigError` for a record or report that is damaged."""
        record = self._read_record()
        path = self.folder / "report.json"
        if path.is_file():
            report = read_json(path)
            reason, message = report.get("stop_reason"), str(report.get("stop_message", ""))
            if reason == StopReason.FAILED:
                return self._result(CellStatus.FAILED, message, record)
            if reason == StopReason.INTERRUPTED:
                return self._result(CellStatus.UNFINISHED, message, record)
            return self._result(CellStatus.FINISHED, message, record, report)
        if record is not None and record.failure is not None:
            return self._result(CellStatus.FAILED, record.failure, record)
        return self._result(CellStatus.UNFINISHED, "", record)

    def _result(
        self,
        status: CellStatus,
        message: str,
        record: CellRecord | None,
        report: Mapping[str, Any] | None = None,
    ) -> CellResult:
        return CellResult(key=self.key, status=status, message=message, record=record, report=report)

    def _read_record(self) -> CellRecord | None:
        if not self.record.is_file():
            return None
        try:
            return CellRecord.model_validate(read_json(self.record))
        except ValidationError as error:
            raise ConfigError(f"{self.record} is not the record of a cell: {error}; remove it") from error


def scene_file_name(scene: str) -> str:
    """`house:3` as `house-3`: what every file system takes."""
    return re.sub(r"[^\w.-]+", "-", scene)


def read_json(path: Path) -> dict[str, Any]:
    """Raises `ConfigError` for anything but a JSON object."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise ConfigError(f"{path} is not JSON: {error}; remove it") from error
    if not isinstance(content, dict):
        raise ConfigError(f"{path} must hold a JSON object, it holds {type(content).__name__}; remove it")
    return content


def write_text(path: Path, content: str) -> None:
    """Whole or not at all: readers never see half a file."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    partial.write_text(content, encoding="utf-8")
    partial.replace(path)
