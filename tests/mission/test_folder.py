"""A run's folder is whole or not there."""

import json
from pathlib import Path

import pytest

from hgs_core.errors import ConfigError
from hgs_core.mission.events import MissionEvent, MissionView, Notice
from hgs_core.mission.folder import EventLog, RunFolder


class Heard:
    def __init__(self) -> None:
        self.events: list[MissionEvent] = []

    def on_event(self, event: MissionEvent) -> None:
        self.events.append(event)

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None:
        raise AssertionError("no view was wanted")


def test_the_name_appears_only_when_complete(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "run")
    (folder.partial / "report.json").write_text("{}")
    assert not (tmp_path / "run").exists()
    folder.complete()
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["report.json"]
    assert not folder.partial.exists()


def test_results_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "map.ply").write_text("precious")
    with pytest.raises(ConfigError, match="exists already"):
        RunFolder(tmp_path / "run")


def test_an_empty_folder_may_be_named(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    RunFolder(tmp_path / "run").complete()


def test_a_killed_run_is_pointed_at(tmp_path: Path) -> None:
    RunFolder(tmp_path / "run")
    with pytest.raises(ConfigError, match=r"run\.partial"):
        RunFolder(tmp_path / "run")


def test_a_discarded_run_leaves_nothing(tmp_path: Path) -> None:
    RunFolder(tmp_path / "run").discard()
    assert list(tmp_path.iterdir()) == []


def test_events_are_lines_of_valid_json(tmp_path: Path) -> None:
    heard = Heard()
    log = EventLog(tmp_path / "events.jsonl", heard)
    log.on_event(Notice(time_s=float("nan"), level="info", message="a\nb"))
    log.close()
    (line,) = (tmp_path / "events.jsonl").read_text().splitlines()
    event = json.loads(line)
    assert event == {"schema": 1, "kind": "notice", "time_s": None, "level": "info", "message": "a\nb"}
    assert len(heard.events) == 1
