"""A run's folder is whole or not there."""

import json
import threading
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
    folder = RunFolder.new(tmp_path / "run")
    (folder.partial / "report.json").write_text("{}")
    assert not (tmp_path / "run").exists()
    folder.complete()
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["report.json"]
    assert not folder.partial.exists()


def test_what_only_an_unfinished_run_needs_goes_with_its_end(tmp_path: Path) -> None:
    with RunFolder.new(tmp_path / "run") as folder:
        for needed in (folder.checkpoints, folder.keyframes / "working"):
            needed.mkdir(parents=True)
            (needed / "file").write_text("x")
        (folder.keyframes / "000000.jpg").write_text("x")
        folder.complete()
    files = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()]
    assert files == ["run/keyframes/000000.jpg"]


def test_a_folder_is_taken_up_once_its_process_has_let_go(tmp_path: Path) -> None:
    first = RunFolder.new(tmp_path / "run")
    taken = []
    waiting = threading.Thread(target=lambda: taken.append(RunFolder.take_up(tmp_path / "run")))
    waiting.start()
    waiting.join(0.3)
    assert taken == []
    with first:
        pass
    waiting.join(30)
    (second,) = taken
    assert not second.is_new


def test_a_run_that_its_process_completes_meanwhile_is_not_taken_up(tmp_path: Path) -> None:
    first = RunFolder.new(tmp_path / "run")
    taken = []
    waiting = threading.Thread(target=lambda: taken.append(RunFolder.take_up(tmp_path / "run")))
    waiting.start()
    waiting.join(0.3)
    with first:
        (first.partial / "report.json").write_text("{}")
        first.complete()
    waiting.join(30)
    assert taken == [None]
    assert RunFolder.take_up(tmp_path / "run") is None


def test_nothing_to_take_up_is_a_new_run(tmp_path: Path) -> None:
    folder = RunFolder.take_up(tmp_path / "run")
    assert folder is not None
    assert folder.is_new


def test_results_are_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "map.ply").write_text("precious")
    with pytest.raises(ConfigError, match="exists already"):
        RunFolder.new(tmp_path / "run")


def test_an_empty_folder_may_be_named(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    RunFolder.new(tmp_path / "run").complete()


def test_a_killed_run_is_pointed_at(tmp_path: Path) -> None:
    RunFolder.new(tmp_path / "run")
    with pytest.raises(ConfigError, match=r"run\.partial.*hgs resume"):
        RunFolder.new(tmp_path / "run")


def test_a_discarded_run_leaves_nothing(tmp_path: Path) -> None:
    RunFolder.new(tmp_path / "run").discard()
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


def test_a_torn_line_is_cut_off_and_what_comes_again_is_written_once(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    log = EventLog(path, Heard())
    for time_s in (0.0, 1.0, 2.0):
        log.on_event(Notice(time_s=time_s, level="info", message="here"))
    log.close()
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:20])
    heard = Heard()
    log = EventLog(path, heard)
    log.go_on_from(1.0)
    assert path.read_bytes() == whole
    told = [(0.0, "before"), (1.0, "here"), (1.0, "another"), (2.0, "here"), (3.0, "here")]
    for time_s, message in told:
        log.on_event(Notice(time_s=time_s, level="info", message=message))
    log.close()
    new = [json.loads(line) for line in path.read_bytes()[len(whole) :].splitlines()]
    assert [(event["time_s"], event["message"]) for event in new] == [
        (1.0, "before"),  # told at the moment that the mission goes on from
        (1.0, "another"),
        (3.0, "here"),
    ]
    assert len(heard.events) == len(told)


def test_lines_that_did_not_fit_on_the_disk_are_written_later(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    log = EventLog(path, Heard())
    log.on_event(Notice(time_s=0.0, level="info", message="a"))
    file = log._file

    class FullDisk:
        closed = False

        def seek(self, position: int) -> None: ...

        def write(self, content: bytes) -> int:
            file.seek(0, 2)
            return file.write(content[:5])

    log._file = FullDisk()
    log.on_event(Notice(time_s=1.0, level="info", message="b"))
    log._file = file
    log.on_event(Notice(time_s=2.0, level="info", message="c"))
    log.close()
    assert [json.loads(line)["message"] for line in path.read_text().splitlines()] == ["a", "b", "c"]
