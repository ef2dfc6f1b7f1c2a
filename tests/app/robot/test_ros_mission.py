"""A whole mission of a ROS 2 robot: `hgs ros` and `hgs serve`, a process each, and a rosbridge server."""

import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from app.robot.rest import ServiceApi
from app.robot.results import finished_mission
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.scene.scene import open_scene
from tests.app.robot.fake_rosbridge import FakeRosRobot
from tests.app.served import served
from tests.mission.small_room import write_small_room

pytest.importorskip("roslibpy", reason="the extra `ros` is not installed")


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_ros_robot_explores_a_room(tmp_path, capsys):
    room = open_scene(write_small_room(tmp_path))
    robot = FakeRosRobot(room, camera=CameraIntrinsics.centred(300, 170, 150.0))
    with served(tmp_path / "data", viewer=False) as service, robot.serving():
        done = subprocess.run(
            [
                str(Path(sys.executable).with_name("hgs")),
                *("ros", "--bridge", robot.url, "--server", service.url, "--preset", "robust"),
            ],
            timeout=1500,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        with capsys.disabled():
            sys.stdout.write(f"\n{done.stdout}")
        only = httpx.get(f"{service.api}/missions").json()["missions"][0]["id"]
        api = ServiceApi(service.url, None)
        mission = finished_mission(api, only, patience_s=300, say=lambda _: None)
    assert mission["stop_reason"] == "complete"
    assert robot.body.collisions == 0
    assert robot.body.path_length_m > 2.0
    assert not robot.moves
