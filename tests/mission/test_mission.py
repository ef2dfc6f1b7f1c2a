"""Short missions in the built-in house: repeatable, interruptible, and honest about how they ended."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import ConfigError, SceneError
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.gaussians.ply import read_ply
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mission.commands import Command
from hgs_core.mission.events import MissionEvent, MissionView, PhaseChanged, PlanMade, Telemetry
from hgs_core.mission.run import MissionRequest, NoCommands, run_mission
from hgs_core.planning.views import ViewMemory


class Heard:
    """Keeps every event; looks at the first views."""

    def __init__(self, views: int = 0) -> None:
        self.events: list[MissionEvent] = []
        self.views: list[tuple[int, tuple[int, ...]]] = []
        self._wanted = views

    def on_event(self, event: MissionEvent) -> None:
        self.events.append(event)

    def wants_view(self) -> bool:
        return len(self.views) < self._wanted

    def on_view(self, view: MissionView) -> None:
        self.views.append((view.snapshot.gaussians.size, view.rendered_rgb.shape))


class Script:
    """Commands given after so many polls."""

    def __init__(self, commands: dict[int, Command]) -> None:
        self._commands = commands
        self._polls = 0

    def poll(self) -> Command | None:
        self._polls += 1
        return self._commands.get(self._polls)


def request(out: Path, *, seed: int = 0, time_s: float = 11.0, **overrides: str) -> MissionRequest:
    settings = {"evaluate": "false", "threads": "1", "mapping.iterations_per_s": "2.5", **overrides}
    return MissionRequest(
        scene="house", preset="quick", seed=seed, out=out, max_time_s=time_s, overrides=settings
    )


def test_a_mission_leaves_a_complete_folder_and_repeats_exactly(tmp_path: Path) -> None:
    heard = Heard(views=2)
    report = run_mission(request(tmp_path / "a"), observer=heard, commands=NoCommands())
    run_mission(request(tmp_path / "b"), observer=Heard(), commands=NoCommands())

    assert report.stop_reason == "time_limit"
    assert report.frames > 20
    assert report.collisions == 0
    assert report.path_length_m is not None
    assert report.path_length_m > 0.3
    assert all(entry.reason != "interrupted" for entry in report.unseen)
    names = {path.name for path in (tmp_path / "a").iterdir()}
    assert names == {
        "config.yaml",
        "events.jsonl",
        "exploration.npz",
        "keyframes",
        "map.ply",
        "mesh.ply",
        "report.html",
        "report.json",
        "trajectory.txt",
        "transforms.json",
    }
    assert MissionReport.read(tmp_path / "a" / "report.json") == report

    first, second = (read_trajectory(tmp_path / name / "trajectory.txt") for name in ("a", "b"))
    np.testing.assert_array_equal(first.poses.as_matrix(), second.poses.as_matrix())
    maps = [read_ply(tmp_path / name / "map.ply") for name in ("a", "b")]
    np.testing.assert_array_equal(maps[0].parameters[: maps[0].size], maps[1].parameters[: maps[1].size])
    assert maps[0].size == report.n_gaussians

    telemetry = [event for event in heard.events if isinstance(event, Telemetry)]
    assert len(telemetry) == report.frames
    assert any(isinstance(event, PlanMade) for event in heard.events)
    lines = (tmp_path / "a" / "events.jsonl").read_text().splitlines()
    assert [json.loads(line)["kind"] for line in lines] == [event.kind for event in heard.events]
    assert [shape for _, shape in heard.views] == [(170, 300, 3)] * 2


def test_every_view_that_ends_a_plan_is_remembered_as_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot stands at the view when it plans anew: one that had turned on would take it for ever."""
    taken: list[tuple[float, float, float]] = []
    remember = ViewMemory.add

    def add(memory: ViewMemory, x_m: float, y_m: float, yaw_rad: float, *, remaining_share: float) -> None:
        taken.append((x_m, y_m, yaw_rad))
        remember(memory, x_m, y_m, yaw_rad, remaining_share=remaining_share)

    monkeypatch.setattr(ViewMemory, "add", add)
    heard = Heard()
    run_mission(request(tmp_path / "run", time_s=20.0), observer=heard, commands=NoCommands())
    plans = [event for event in heard.events if isinstance(event, PlanMade)]
    after_views = [plan for plan in plans if plan.reason.startswith("viewpoint taken")]
    assert len(after_views) >= 3
    assert len(taken) >= len(after_views)


def test_stop_waits_for_no_frame_and_leaves_a_complete_folder(tmp_path: Path) -> None:
    script = Script({4: Command.STOP})
    report = run_mission(request(tmp_path / "run"), observer=Heard(), commands=script)
    assert report.stop_reason == "interrupted"
    assert report.frames <= 2
    assert (tmp_path / "run" / "map.ply").is_file()
    assert report.psnr_db is None
    keyframes = KeyframeArchive.open(tmp_path / "run")
    assert len(keyframes) == report.keyframes == 1
    assert keyframes.load(0).rgb.shape == (340, 600, 3)
    files = sorted(path.name for path in (tmp_path / "run" / "keyframes").iterdir())
    assert files == ["000000.jpg", "000000_depth.png"]


def test_by_the_real_clock_every_frame_is_taken_or_counted_as_lost(tmp_path: Path) -> None:
    heard = Heard()
    wish = replace(request(tmp_path / "run", time_s=6.0), clock="real")
    report = run_mission(wish, observer=heard, commands=NoCommands())
    assert report.clock == "real"
    assert report.stop_reason == "time_limit"
    assert report.sim_time_s is not None
    # The robot may have lived on for a while after the frame that was taken last.
    due = report.frames + report.frames_dropped
    assert due <= report.sim_time_s / 0.4 + 1.001
    last = [event for event in heard.events if isinstance(event, Telemetry)][-1]
    assert (last.frames_dropped, last.iterations) == (report.frames_dropped, report.iterations)
    stamps = read_trajectory(tmp_path / "run" / "trajectory.txt").timestamps_s
    assert len(stamps) == report.frames
    assert np.all(np.diff(stamps) > 0)


def test_pause_holds_the_clock_until_resumed(tmp_path: Path) -> None:
    heard = Heard()
    script = Script({3: Command.PAUSE, 6: Command.RESUME, 12: Command.STOP})
    run_mission(request(tmp_path / "run"), observer=heard, commands=script)
    phases = [event for event in heard.events if isinstance(event, PhaseChanged)]
    paused = next(event for event in phases if event.phase == "paused")
    resumed = phases[phases.index(paused) + 1]
    assert resumed.phase == "running"
    assert resumed.time_s == paused.time_s


def test_what_cannot_begin_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no mission preset"):
        run_mission(
            MissionRequest(
                scene="house", preset="no", seed=0, out=tmp_path / "x", max_time_s=None, overrides={}
            ),
            observer=Heard(),
            commands=NoCommands(),
        )
    broken = tmp_path / "broken.ply"
    broken.write_text("not a mesh")
    with pytest.raises(SceneError):
        run_mission(
            MissionRequest(
                scene=str(broken), preset="quick", seed=0, out=tmp_path / "x", max_time_s=None, overrides={}
            ),
            observer=Heard(),
            commands=NoCommands(),
        )
    assert [path.name for path in tmp_path.iterdir()] == ["broken.ply"]
