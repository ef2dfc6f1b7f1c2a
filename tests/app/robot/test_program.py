"""`hgs robot` and the example client against the real service: shortened missions over loopback."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from typer.testing import CliRunner

from app.cli.application import application
from app.cli.exit_codes import ExitCode
from app.robot.link_faults import LinkFaults
from app.robot.options import RobotOptions
from app.robot.outcome import Outcome
from app.robot.program import run_robot
from app.settings import Settings
from hgs_core.errors import ConfigError, RobotError
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.simulation.driven_world import BodyFaults
from tests.app.live_service import LiveService, serving
from tests.app.robot.robots import in_a_thread
from tests.mission.small_room import TINY, write_small_room

SETTINGS = {
    **TINY,
    "limits.max_time_s": "4",
    "live.dead_man_s": "20",
    "live.frame_s": "30",
    "live.command_s": "20",
}
"""Patient: the machine may be busy."""


@pytest.fixture(scope="module")
def service(tmp_path_factory) -> Iterator[LiveService]:
    settings = Settings(data_dir=tmp_path_factory.mktemp("robots"), mission_threads=1, viewer=False)
    with serving(settings) as served:
        yield served


def options(service: LiveService, folder: Path, **changes) -> RobotOptions:
    settings = {key: value for key, value in SETTINGS.items() if key != "sensor"}
    return RobotOptions(
        server=service.url,
        out=folder / "out",
        scene=str(write_small_room(folder)),
        sensor="rgbd_5m_tiny",
        preset="quick",
        settings=settings,
        evaluate=False,
        **changes,
    )


def test_a_shortened_mission_with_everything_wrong_with_the_robot(service, tmp_path) -> None:
    said: list[str] = []
    faults = {
        "body_faults": BodyFaults(wheel_slip=0.1, drift_percent=1.0, drift_deg_per_m=0.3, depth_holes=0.1),
        "link_faults": LinkFaults(latency_s=0.05, drop_frames=0.1),
    }
    run = in_a_thread(
        run_robot,
        options(service, tmp_path, clock_offset_s=500.0, depth_format="zstd", **faults),
        said.append,
    )
    assert run.outcome is Outcome.ENDED, said
    assert run.report.stop_reason in ("time_limit", "complete"), said
    assert run.report.collisions == 0
    assert run.report.frames == run.robot.frames_sent >= 3
    assert run.robot.frames_taken >= 1
    assert run.robot.faults["wheel_slip"] == 0.1
    out = tmp_path / "out"
    assert MissionReport.read(out / "report.json") == run.report
    assert json.loads((out / "robot.json").read_text())["mission"] == run.robot.mission
    assert (out / "map.ply").stat().st_size > 1000
    true, estimated = read_trajectory(out / "trajectory.txt"), read_trajectory(out / "estimated.txt")
    assert len(true) == len(estimated) >= run.robot.frames_sent
    assert {path.name for path in out.iterdir()} == {
        *("report.json", "robot.json", "map.ply", "trajectory.txt", "estimated.txt")
    }


def test_a_mission_that_waits_for_its_robot_and_is_stopped_by_its_operator(service, tmp_path) -> None:
    api = httpx.Client(base_url=f"{service.url}api/v1", timeout=60)
    order = {"scene": "live", "preset": "quick", "overrides": SETTINGS}
    mission = api.post("/missions", json=order).raise_for_status().json()["id"]
    api.post(f"/missions/{mission}/stop").raise_for_status()
    with pytest.raises(RobotError, match="takes no robot: the mission is aborted"):
        in_a_thread(run_robot, options(service, tmp_path, mission=mission), lambda _: None)
    assert not (tmp_path / "out").exists()


def test_what_is_wrong_is_told_before_anything_is_made(service, tmp_path) -> None:
    before = httpx.get(f"{service.url}api/v1/missions").json()["missions"]
    with pytest.raises(ConfigError, match="no sensor preset 'none'"):
        in_a_thread(
            run_robot,
            RobotOptions(server=service.url, out=tmp_path / "out", scene="house", sensor="none"),
            lambda _: None,
        )
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(ConfigError, match="exists already"):
        in_a_thread(
            run_robot, RobotOptions(server=service.url, out=tmp_path / "full", scene="house"), lambda _: None
        )
    assert httpx.get(f"{service.url}api/v1/missions").json()["missions"] == before


@pytest.mark.parametrize(
    ("arguments", "code", "complaint"),
    [
        (["--scene", "house"], ExitCode.USAGE, "--out"),
        (["--scene", "house", "--out", "OUT", "--vehicle", "boat"], ExitCode.USAGE, "ackermann"),
        (["--scene", "house", "--out", "OUT", "--pose-drift", "-1", "0"], ExitCode.USAGE, "--pose-drift"),
        (["--out", "OUT"], ExitCode.USAGE, "--scene is missing"),
        (["--record", "OUT"], ExitCode.USAGE, "--along"),
        (["--recorded", "OUT", "--out", "OUT"], ExitCode.USAGE, "no recording"),
        (["--scene", "ROOM", "--out", "OUT", "--server", "ftp://x"], ExitCode.USAGE, "expected http://"),
        (["--scene", "ROOM", "--out", "OUT", "--server", "http://127.0.0.1:9"], ExitCode.FAILED, "refused"),
    ],
)
def test_the_command_line_says_what_is_wrong(tmp_path, arguments, code, complaint) -> None:
    room = str(write_small_room(tmp_path))
    places = {"OUT": str(tmp_path / "out"), "ROOM": room}
    result = CliRunner().invoke(application, ["robot", *(places.get(word, word) for word in arguments)])
    assert result.exit_code == code, result.output
    assert complaint in " ".join(result.output.split())


def test_the_example_client_is_driven_by_the_service(service, repository) -> None:
    """docs/examples/own_robot.py as people run it: it explores its room until the mission's time is up."""
    example = repository / "docs" / "examples" / "own_robot.py"
    assert len(example.read_text().splitlines()) <= 100
    api = httpx.Client(base_url=f"{service.url}api/v1", timeout=60)
    order = {"scene": "live", "preset": "quick", "overrides": SETTINGS}
    mission = api.post("/missions", json=order).raise_for_status().json()["id"]
    api.post(f"/missions/{mission}/start").raise_for_status()
    url = f"ws://127.0.0.1:{service.port}/api/v1/ingest/{mission}"
    done = subprocess.run(
        [sys.executable, str(example), url], capture_output=True, text=True, timeout=120, check=False
    )
    assert "the mission is over: time limit" in done.stdout, done.stderr
    figures = api.get(f"/missions/{mission}").json()["figures"]
    assert figures["frame"] >= 3
    assert figures["n_gaussians"] > 100


def test_a_service_that_is_away_is_waited_for(tmp_path) -> None:
    """A robot that is given its mission starts before its service is back; nobody comes, so it gives up."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    said: list[str] = []
    wish = RobotOptions(
        server=f"http://127.0.0.1:{port}",
        out=tmp_path / "out",
        mission="20200101-000000-0123456789ab",
        scene=str(write_small_room(tmp_path)),
        sensor="rgbd_5m_tiny",
        preset="quick",
        give_up_after_s=0.5,
    )
    run = in_a_thread(run_robot, wish, said.append)
    assert run.outcome is Outcome.GIVEN_UP
    assert any("not there yet" in line for line in said)
