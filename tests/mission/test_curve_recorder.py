"""The completion curve of a mission: when it is read, what it costs the mission, and how it ends."""

from collections.abc import Callable
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hgs_core.evaluation.completion_curve import CompletionTracker
from hgs_core.evaluation.report import MissionReport
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.ply import read_ply
from hgs_core.mapping.mapper import Mapper
from hgs_core.mission.clock import LockstepClock, RealClock
from hgs_core.mission.config import resolve_mission_config
from hgs_core.mission.curve_recorder import CurveRecorder
from hgs_core.mission.events import MissionEvent, MissionView, Telemetry
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.run import NoCommands, run_mission
from tests.app.test_cli_evaluate import SMALL_CAMERA, write_room
from tests.mission.passing_time import PassingTime

SAMPLES = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [3.0, 0, 0]])


class Heard:
    def __init__(self) -> None:
        self.events: list[MissionEvent] = []

    def on_event(self, event: MissionEvent) -> None:
        self.events.append(event)

    def wants_view(self) -> bool:
        return True

    def on_view(self, view: MissionView) -> None:
        raise AssertionError("no view is made here")


class GrowingMapper(Mapper):
    """One more of the samples is mapped whenever the map is asked for, which takes as long as it is told."""

    def __init__(self, wait: Callable[[], None] = lambda: None) -> None:
        self._map = GaussianMap()
        self._wait = wait

    @property
    def gaussians(self) -> GaussianMap:
        self._wait()
        row = np.zeros((1, 8), np.float32)
        row[0, :3] = SAMPLES[self._map.size]
        self._map.append(row, anchor_keyframe=0)
        return self._map


def telemetry(time_s: float, path_m: float) -> Telemetry:
    zeros = dict.fromkeys((field.name for field in fields(Telemetry)), 0)
    return Telemetry(**{**zeros, "time_s": time_s, "path_length_m": path_m})


def recorder(
    clock: LockstepClock | RealClock, observer: Heard, wait: Callable[[], None] = lambda: None
) -> CurveRecorder:
    return CurveRecorder(
        CompletionTracker(SAMPLES),
        interval_m=1.0,
        interval_s=2.0,
        mapper=GrowingMapper(wait),
        clock=clock,
        observer=observer,
    )


def test_a_reading_is_due_after_metres_or_seconds() -> None:
    heard = Heard()
    curve = recorder(LockstepClock(0.4), heard)
    frames = [(0.0, 0.0), (0.4, 0.4), (1.2, 1.1), (2.0, 1.5), (3.3, 1.6), (3.6, 1.7)]
    for frame in frames:
        curve.on_event(telemetry(*frame))
    points = curve.finished(1.8, 4.0)
    assert [(point.time_s, point.path_m) for point in points] == [
        *((0.0, 0.0), (1.2, 1.1), (3.3, 1.6)),
        (4.0, 1.8),
    ]
    assert [point.ratio for point in points] == [0.25, 0.5, 0.75, 1.0]
    assert len(heard.events) == len(frames)
    assert curve.wants_view()


def test_the_end_is_read_once() -> None:
    """A mission that ends with the frame of a reading: the map was pruned since, and is read again."""
    curve = recorder(LockstepClock(0.4), Heard())
    curve.on_event(telemetry(0.0, 0.0))
    curve.on_event(telemetry(2.0, 1.5))
    points = curve.finished(1.5, 2.0)
    assert [(point.time_s, point.ratio) for point in points] == [(0.0, 0.25), (2.0, 0.75)]


def test_the_real_clock_stands_still_during_a_reading() -> None:
    time = PassingTime()
    clock = RealClock(0.4, now=time.now, sleep=time.sleep)
    clock.elapsed_s(nominal_s=0.0)
    curve = recorder(clock, Heard(), wait=lambda: time.sleep(5.0))
    time.sleep(0.1)
    curve.on_event(telemetry(0.0, 0.0))
    time.sleep(0.1)
    assert clock.elapsed_s(nominal_s=0.0) == pytest.approx(0.2)


@pytest.mark.parametrize("preset", ["bench", "robust"])
def test_presets_for_grids_record_it(preset: str) -> None:
    assert resolve_mission_config(preset, {}).curve_interval_m == 1.0
    assert resolve_mission_config("paper", {}).curve_interval_m == 0.0


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The same short mission in an empty room with a tiny camera, with a curve and without."""
    folder = tmp_path_factory.mktemp("curve")
    write_room(folder / "room.ply")
    settings = {**SMALL_CAMERA, "mapping.iterations_per_s": "2.5", "mesh.enabled": "false"}
    request = MissionRequest(
        scene=str(folder / "room.ply"),
        preset="quick",
        seed=0,
        out=folder / "with",
        max_time_s=11.0,
        overrides={**settings, "curve_interval_m": "0.5"},
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("HGS_CACHE_DIR", str(folder / "cache"))
        run_mission(request, observer=Heardless(), commands=NoCommands())
        plain = {**settings, "evaluate": "false"}
        run_mission(
            replace(request, out=folder / "without", overrides=plain),
            observer=Heardless(),
            commands=NoCommands(),
        )
    return {name: folder / name for name in ("with", "without")}


class Heardless:
    """An observer that wants nothing."""

    def on_event(self, event: MissionEvent) -> None:
        del event

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None:
        del view


def test_a_curve_changes_nothing_of_the_mission(runs: dict[str, Path]) -> None:
    for name in ("trajectory.txt", "map.ply"):
        assert (runs["with"] / name).read_bytes() == (runs["without"] / name).read_bytes()
    plain = MissionReport.read(runs["without"] / "report.json")
    assert plain.completion_curve == ()
    assert (plain.path_m_at_90, plain.curve_wall_s) == (None, None)


def test_the_curve_rises_and_ends_with_the_evaluation(runs: dict[str, Path]) -> None:
    report = MissionReport.read(runs["with"] / "report.json")
    curve = report.completion_curve
    ratios = [point.ratio for point in curve]
    assert len(curve) > 4
    assert ratios[:-1] == sorted(ratios[:-1])
    assert 0 < ratios[0] < ratios[-2] < 1
    assert ratios[-1] == report.completion_ratio_observable
    assert (curve[-1].path_m, curve[-1].time_s) == (report.path_length_m, report.sim_time_s)
    assert all(
        after.path_m - before.path_m >= 0.5 or after.time_s - before.time_s >= 2.0
        for before, after in pairwise(curve[:-1])
    )
    assert read_ply(runs["with"] / "map.ply").size == report.n_gaussians
    assert "Completion ratio, observable" in (runs["with"] / "report.html").read_text()
    assert "Completion ratio, observable" not in (runs["without"] / "report.html").read_text()
