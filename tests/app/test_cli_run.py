"""`hgs run`: what reaches the mission, what the exit code says, and what Ctrl-C does."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.application import application
from app.cli.exit_codes import ExitCode, exit_code_of
from hgs_core.errors import SceneError
from hgs_core.evaluation.report import MissionReport
from hgs_core.mission import run as mission_run
from hgs_core.mission.commands import Command, CommandSource
from hgs_core.mission.events import (
    MissionObserver,
    MissionPhase,
    Notice,
    PhaseChanged,
    PlanMade,
    StopReason,
    Telemetry,
)
from hgs_core.mission.run import MissionRequest

RunMission = Callable[..., MissionReport]


def report(stop_reason: str = "complete") -> MissionReport:
    return MissionReport(
        scene="house",
        seed=4,
        planner="paper",
        stop_reason=stop_reason,
        frames=10,
        keyframes=2,
        n_gaussians=12345,
        versions={},
        kernel_variant="test",
        threads=1,
        completion_ratio_observable=0.954,
    )


def telemetry(frame: int = 0) -> Telemetry:
    return Telemetry(
        time_s=0.4 * frame,
        frame=frame,
        x_m=0.0,
        y_m=0.0,
        yaw_rad=0.0,
        path_length_m=1.5,
        collisions=0,
        n_gaussians=54321,
        n_keyframes=1,
        observed_volume_m3=10.0,
        missing_volume_m3=2.5,
        psnr_current_db=float("nan"),
        mapping_s=0.1,
        iterations=10 * (frame + 1),
        frames_dropped=0,
        frames_thinned=0,
        wall_s=3.0,
    )


@pytest.fixture
def missions(monkeypatch: pytest.MonkeyPatch) -> Callable[[RunMission], None]:
    """Put a fake in the place of `run_mission`."""
    return lambda fake: monkeypatch.setattr(mission_run, "run_mission", fake)


def hgs(*arguments: str):
    return CliRunner().invoke(application, list(arguments))


RUN = ("run", "--scene", "house", "--out", "results")


def test_options_become_a_request(missions: Callable[[RunMission], None]) -> None:
    requests: list[MissionRequest] = []

    def fake(request: MissionRequest, *, observer: MissionObserver, commands: CommandSource) -> MissionReport:
        requests.append(request)
        return report()

    missions(fake)
    options = ("--preset", "quick", "--seed", "4", "--max-time", "60", "--clock", "real")
    settings = ("--set", "threads=1", "--set", "gain.prior_information = 0.2")
    result = hgs(*RUN, *options, *settings)
    assert result.exit_code == 0, result.output
    assert requests == [
        MissionRequest(
            scene="house",
            preset="quick",
            seed=4,
            out=Path("results"),
            max_time_s=60.0,
            overrides={"threads": "1", "gain.prior_information": "0.2"},
            clock="real",
        )
    ]


@pytest.mark.parametrize("reason", list(StopReason))
def test_the_exit_code_tells_how_the_mission_ended(
    missions: Callable[[RunMission], None], reason: StopReason
) -> None:
    missions(lambda request, **_: report(reason))
    expected = {"complete": 0, "interrupted": 130, "time_limit": 3, "stuck": 3, "path_budget": 3, "failed": 4}
    expected["stream_ended"] = 0
    assert hgs(*RUN).exit_code == expected[reason] == exit_code_of(reason)


def test_the_final_table_shows_the_figures(missions: Callable[[RunMission], None]) -> None:
    missions(lambda request, **_: report())
    result = hgs(*RUN)
    assert "12,345" in result.stdout
    assert "0.954" in result.stdout
    assert "results: results" in result.stdout


def test_progress_is_told_line_by_line_without_a_terminal(missions: Callable[[RunMission], None]) -> None:
    def fake(request: MissionRequest, *, observer: MissionObserver, commands: CommandSource) -> MissionReport:
        observer.on_event(PhaseChanged(time_s=0, phase=MissionPhase.RUNNING, reason="looking around"))
        observer.on_event(telemetry())
        observer.on_event(Notice(time_s=0, level="warning", message="a [texture] is missing"))
        observer.on_event(
            PlanMade(
                time_s=0,
                plan_sequence=1,
                reason="best view",
                n_candidates=3,
                n_selected=1,
                n_reconstructing=2,
                path_length_m=1.0,
                observed_share=0.5,
                planning_s=0.1,
                viewpoint_evaluation_s=0.06,
                local_s=0.01,
                global_s=0.03,
                candidates=(),
            )
        )
        observer.on_event(PhaseChanged(time_s=0, phase=MissionPhase.ENDED, reason="nothing left"))
        assert not observer.wants_view()
        return report()

    missions(fake)
    told = hgs(*RUN).stderr
    assert "running: looking around" in told
    assert "warning: a [texture] is missing" in told
    assert "ended: nothing left" in told
    assert "54,321" in told
    assert "missing 2.50" in told


def test_interrupts_stop_the_mission_once_and_never_kill_it(missions: Callable[[RunMission], None]) -> None:
    polled: list[Command | None] = []

    def fake(request: MissionRequest, *, observer: MissionObserver, commands: CommandSource) -> MissionReport:
        polled.append(commands.poll())
        os.kill(os.getpid(), signal.SIGINT)
        polled.append(commands.poll())
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
        polled.append(commands.poll())
        return report("interrupted")

    missions(fake)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    result = hgs(*RUN)
    assert result.exit_code == ExitCode.INTERRUPTED == 130
    assert polled == [None, Command.STOP, None]
    assert "stopping: what was reached is written" in result.stderr
    assert result.stderr.count("already stopping") == 2
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_sigterm_stops_as_ctrl_c_does(missions: Callable[[RunMission], None]) -> None:
    def fake(request: MissionRequest, *, observer: MissionObserver, commands: CommandSource) -> MissionReport:
        os.kill(os.getpid(), signal.SIGTERM)
        assert commands.poll() is Command.STOP
        return report("interrupted")

    missions(fake)
    assert hgs(*RUN).exit_code == ExitCode.INTERRUPTED


def test_an_expected_error_is_one_line(missions: Callable[[RunMission], None]) -> None:
    def fake(request: MissionRequest, **_: object) -> MissionReport:
        raise SceneError("lamp.glb has no triangles")

    missions(fake)
    result = hgs(*RUN)
    assert result.exit_code == ExitCode.USAGE == 2
    assert result.stderr.strip() == "error: lamp.glb has no triangles"


def test_a_full_disk_is_a_failure_and_a_defect_keeps_its_traceback(
    missions: Callable[[RunMission], None],
) -> None:
    def full(request: MissionRequest, **_: object) -> MissionReport:
        raise OSError(28, "No space left on device", "results")

    missions(full)
    assert hgs(*RUN).exit_code == ExitCode.FAILED == 4

    def defective(request: MissionRequest, **_: object) -> MissionReport:
        raise ZeroDivisionError

    missions(defective)
    result = hgs(*RUN)
    assert result.exit_code == 1
    assert isinstance(result.exception, ZeroDivisionError)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("run", "--out", "x"), "--scene"),
        (("run", "--scene", "house"), "--out"),
        ((*RUN, "--seed", "-1"), "--seed"),
        ((*RUN, "--max-time", "soon"), "--max-time"),
        ((*RUN, "--set", "threads"), "KEY=VALUE"),
        ((*RUN, "--set", "threads=1", "--set", "threads=2"), "twice"),
        ((*RUN, "--speed", "9"), "--speed"),
    ],
)
def test_wrong_options_are_usage_errors(arguments: tuple[str, ...], told: str) -> None:
    result = hgs(*arguments)
    assert result.exit_code == ExitCode.USAGE
    assert told in result.stderr


def test_a_wrong_preset_or_setting_names_what_is_allowed_and_leaves_nothing(tmp_path: Path) -> None:
    where = ("run", "--scene", "house", "--out", str(tmp_path / "out"))
    result = hgs(*where, "--preset", "papier")
    assert result.exit_code == ExitCode.USAGE
    assert "paper" in result.stderr
    result = hgs(*where, "--set", "robot.radius_m=-1")
    assert result.exit_code == ExitCode.USAGE
    assert "robot.radius_m" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_help_states_every_exit_code() -> None:
    told = hgs("run", "--help").output
    for code in ExitCode:
        assert f"{int(code)} - " in told
