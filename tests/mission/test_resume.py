"""A mission that was killed anywhere goes on from its last checkpoint to the end of one that was not."""

import json
from pathlib import Path

import pytest

from hgs_core.evaluation.report import MissionReport
from hgs_core.mission.events import Command, MissionEvent, MissionView, Telemetry
from hgs_core.mission.finished_run import resuming_request
from hgs_core.mission.run import MissionRequest, NoCommands, run_mission

TINY = {
    "sensor": "rgbd_5m_tiny",
    "evaluate": "false",
    "threads": "1",
    "mapping.iterations_per_s": "2.5",
    "mapping.insertion.widest_factor": "2",
    "mesh.enabled": "false",
    "checkpoint.interval_s": "2",
    "checkpoint.most_share": "1",
}
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


def request(out: Path, *, time_s: float = 10.0, **overrides: str) -> MissionRequest:
    return MissionRequest(
        scene="house", preset="quick", seed=0, out=out, max_time_s=time_s, overrides={**TINY, **overrides}
    )


def kill_at(frame: int, wish: MissionRequest) -> None:
    with pytest.raises(Killed):
        run_mission(wish, observer=Watched(frame), commands=NoCommands())


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("undisturbed") / "run"
    run_mission(request(out), observer=Watched(), commands=NoCommands())
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


@pytest.mark.parametrize("frames", [(2,), (17, 22)])
def test_a_killed_mission_ends_as_one_that_was_not(tmp_path: Path, undisturbed: Path, frames: tuple) -> None:
    wish = request(tmp_path / "run")
    for frame in frames:
        kill_at(frame, wish)
        assert not (tmp_path / "run").exists()
        wish = resuming_request(tmp_path / "run")
    heard = Watched()
    report = run_mission(wish, observer=heard, commands=NoCommands())
    assert report is not None
    assert report.stop_reason == "time_limit"
    resumed = [event for event in heard.events if event.kind == "resumed"]
    assert len(resumed) == 1
    assert (resumed[0].time_s > 0) == (frames != (2,))
    assert_same_end(tmp_path / "run", undisturbed)
