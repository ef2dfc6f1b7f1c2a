"""A mission that was killed anywhere goes on from its last checkpoint to the end of one that was not."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from hgs_core.errors import CheckpointError, ConfigError
from hgs_core.evaluation.report import MissionReport
from hgs_core.mission.checkpoint import CheckpointFolder
from hgs_core.mission.commands import Command
from hgs_core.mission.events import MissionEvent, MissionView, Telemetry
from hgs_core.mission.finished_run import resuming_request
from hgs_core.mission.run import MissionRequest, NoCommands, run_mission
from hgs_core.mission.state_file import StateWriter
from tests.mission.small_room import TINY, write_small_room

MEASURED = (
    *("wall_s", "peak_rss_mib", "planning_s", "mapping_s_per_frame", "real_time_factor", "simulation_wall_s"),
    *("evaluation_s", "curve_wall_s"),
)
"""Figures of a report that are wall time or memory."""


class Killed(BaseException):
    """What no `except` on the way can know of."""


class Watched:
    """Keeps what it hears; kills its mission when frame `last` is told."""

    def __init__(self, last: int | None = None) -> None:
        self.events: list[MissionEvent] = []
        self._last = last

    def on_event(self, event: MissionEvent) -> None:
        self.events.append(event)
        if isinstance(event, Telemetry) and event.frame == self._last:
            raise Killed

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None: ...


class SuspendAfter:
    """Suspends the mission at its n-th poll."""

    def __init__(self, polls: int) -> None:
        self._left = polls

    def poll(self) -> Command | None:
        self._left -= 1
        return Command.SUSPEND if self._left == 0 else None


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_small_room(tmp_path_factory.mktemp("room"))


def request(room: Path, out: Path, *, time_s: float = 14.0, **overrides: str) -> MissionRequest:
    settings = {**TINY, **overrides}
    return MissionRequest(
        scene=str(room), preset="quick", seed=0, out=out, max_time_s=time_s, overrides=settings
    )


def kill_at(frame: int, wish: MissionRequest) -> None:
    with pytest.raises(Killed):
        run_mission(wish, observer=Watched(frame), commands=NoCommands())


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, room: Path) -> Path:
    out = tmp_path_factory.mktemp("undisturbed") / "run"
    run_mission(request(room, out), observer=Watched(), commands=NoCommands())
    return out


def assert_same_end(found: Path, undisturbed: Path) -> None:
    """All files are the same, wall times excepted; the log tells the same once, and of the resumption."""
    names = [
        {path.relative_to(run).as_posix() for path in run.rglob("*") if path.is_file()}
        for run in (found, undisturbed)
    ]
    assert names[0] == names[1]
    for name in names[0] - {"report.json", "report.html", "events.jsonl"}:
        assert (found / name).read_bytes() == (undisturbed / name).read_bytes(), name
    reports = [MissionReport.read(run / "report.json") for run in (found, undisturbed)]
    figures = [report.model_dump(exclude=set(MEASURED)) for report in reports]
    assert figures[0] == figures[1]
    assert of_mission(found) == of_mission(undisturbed)


def of_mission(run: Path) -> list[dict]:
    """What the log tells of the mission itself, without wall times."""
    told = []
    for line in (run / "events.jsonl").read_text().splitlines():
        event = json.loads(line)
        if event["kind"] in ("telemetry", "plan", "notice", "ended"):
            kept = {key for key in event if not key.endswith("_s") or key == "time_s"}
            told.append({key: event[key] for key in kept})
    return told


@pytest.mark.parametrize("frames", [(2,), (20, 31)])
def test_a_killed_mission_ends_as_one_that_was_not(
    tmp_path: Path, room: Path, undisturbed: Path, frames: tuple[int, ...]
) -> None:
    wish = request(room, tmp_path / "run")
    for frame in frames:
        kill_at(frame, wish)
        assert not (tmp_path / "run").exists()
        wish = resuming_request(tmp_path / "run")
    heard = Watched()
    report = run_mission(wish, observer=heard, commands=NoCommands())
    assert report is not None
    assert report.stop_reason == "time_limit"
    (resumed,) = [event for event in heard.events if event.kind == "resumed"]
    assert (resumed.time_s > 0) == (frames != (2,))
    assert_same_end(tmp_path / "run", undisturbed)
    with pytest.raises(ConfigError, match="is complete"):
        resuming_request(tmp_path / "run")


def test_a_suspended_mission_goes_on_from_its_last_frame(
    tmp_path: Path, room: Path, undisturbed: Path
) -> None:
    wish = request(room, tmp_path / "run", **{"checkpoint.interval_s": "0"})
    heard = Watched()
    assert run_mission(wish, observer=heard, commands=SuspendAfter(60)) is None
    assert not (tmp_path / "run").exists()
    assert heard.events[-1].as_json()["phase"] == "suspended"
    frames = [event for event in heard.events if isinstance(event, Telemetry)]
    again = Watched()
    run_mission(replace(wish, resume=True), observer=again, commands=NoCommands())
    (resumed,) = [event for event in again.events if event.kind == "resumed"]
    assert resumed.time_s > frames[-1].time_s
    assert of_mission(tmp_path / "run") == of_mission(undisturbed)


def test_of_damaged_checkpoints_the_newest_whole_one_is_used(
    tmp_path: Path, room: Path, undisturbed: Path
) -> None:
    kill_at(24, request(room, tmp_path / "run"))
    partial = tmp_path / "run.partial"
    older, newest = sorted((partial / "checkpoint").iterdir())
    checkpoints = CheckpointFolder(partial, partial / "checkpoint")
    found, complaints = checkpoints.newest()
    assert found is not None
    assert (found.path, complaints) == (newest, [])
    # A keyframe that only the newest refers to, changed in one byte.
    newest.rename(tmp_path / "away")
    old, _ = checkpoints.newest()
    (tmp_path / "away").rename(newest)
    assert old is not None
    assert old.path == older
    image = partial / sorted(found.files - old.files)[0]
    content = bytearray(image.read_bytes())
    content[-1] ^= 1
    image.write_bytes(content)
    found, (complaint,) = checkpoints.newest()
    assert found is not None
    assert found.path == older
    assert image.name in complaint
    # Torn in the middle: said, and gone on from the older one.
    newest.write_bytes(newest.read_bytes()[: newest.stat().st_size // 2])
    heard = Watched()
    run_mission(resuming_request(tmp_path / "run"), observer=heard, commands=NoCommands())
    assert [e.message for e in heard.events if e.kind == "notice" and "torn or damaged" in e.message]
    assert (tmp_path / "run" / "map.ply").read_bytes() == (undisturbed / "map.ply").read_bytes()


def test_what_cannot_be_gone_on_with_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no run for .* was begun"):
        resuming_request(tmp_path / "run")
    partial = tmp_path / "run.partial"
    partial.mkdir()
    with pytest.raises(ConfigError, match="had not begun"):
        resuming_request(tmp_path / "run")
    folder = CheckpointFolder(partial, partial / "checkpoint")
    with pytest.raises(CheckpointError, match=r"state\.parts"):
        folder.begin({"parts": object()}, [])
    assert list((partial / "checkpoint").iterdir()) == []
    folder.begin({"parts": 1}, [])
    folder.finish()
    (path,) = (partial / "checkpoint").iterdir()
    with path.open("wb") as file:
        writer = StateWriter(file)
        writer.write({"format": 99})
        writer.close()
    with pytest.raises(CheckpointError, match=r"format 99.*the version that wrote it"):
        folder.newest()
