"""Frames that are rendered beforehand, and sent as by somebody who carries the camera."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.robot.carried_camera import CarriedCamera
from app.robot.clock import RobotClock
from app.robot.outcome import Outcome
from app.robot.program import region_of
from app.robot.recording import FrameRecording, record, resampled
from app.robot.results import batched
from hgs_core.errors import ConfigError, StreamError
from hgs_core.evaluation.trajectory import Trajectory
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.live.images import decoded_depth
from hgs_core.live.messages import Bye, Frame, Hello
from hgs_core.simulation.depth_holes import DepthHoles
from tests.app.robot.fake_service import FakeService
from tests.app.robot.robots import CAMERA, SCANNER, running, scene


def trajectory() -> Trajectory:
    """Half a metre ahead in a second, a quarter turn in the next."""
    poses = [level_camera_pose(*at) for at in ((0, 0, 1, 0), (0.5, 0, 1, 0), (0.5, 0, 1, math.pi / 2))]
    return Trajectory(timestamps_s=np.array([7.0, 8.0, 9.0]), poses=batched(poses))


def recorded(folder, *, depth_format="png", seed=0):
    noise, holes = np.random.SeedSequence(seed).spawn(2)
    return record(
        scene(),
        "room.glb",
        trajectory(),
        folder,
        camera=CAMERA.model_copy(update={"frame_interval_s": 0.25}),
        scanner=SCANNER,
        region_m=region_of(scene()),
        depth_format=depth_format,
        holes=DepthHoles(0.2, np.random.default_rng(holes)),
        rng=np.random.default_rng(noise),
        progress=lambda _k, _n: None,
    )


def test_a_path_between_its_poses() -> None:
    path = resampled(trajectory(), 0.25)
    np.testing.assert_allclose(path.timestamps_s, 0.25 * np.arange(9))
    np.testing.assert_allclose(path.poses.translation[:, 0], [0, 0.125, 0.25, 0.375, 0.5, 0.5, 0.5, 0.5, 0.5])
    forward = path.poses.rotation[:, :, 2]
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    np.testing.assert_allclose(yaw[4:], np.linspace(0, math.pi / 2, 5), atol=1e-9)
    with pytest.raises(StreamError, match="two poses or more"):
        resampled(Trajectory(timestamps_s=np.array([1.0]), poses=trajectory().poses[:1]), 0.2)


@pytest.mark.parametrize("depth_format", ["png", "zstd"])
def test_what_is_recorded_is_what_is_sent(tmp_path, depth_format) -> None:
    assert recorded(tmp_path / "frames", depth_format=depth_format) == 9
    recording = FrameRecording(tmp_path / "frames")
    first, last = recording.frame(0, 1.0), recording.frame(8, 2.0)
    ahead = decoded_depth(first, CAMERA.intrinsics())[17, 30]
    assert ahead == 0.0 or ahead == pytest.approx(3.0, abs=0.03)
    assert (last.pose[3], last.pose[7]) == pytest.approx((0.5, 0.0))
    assert last.scan.first_bearing_rad == pytest.approx(math.pi / 2)
    assert np.frombuffer(last.scan.ranges_m, "<f4")[0] == pytest.approx(2.0, abs=0.03)
    recorded(tmp_path / "again", depth_format=depth_format)
    assert FrameRecording(tmp_path / "again").frame(3, 0.0) == recording.frame(3, 0.0)
    with pytest.raises(ConfigError, match="exists already"):
        recorded(tmp_path / "frames")


def test_a_damaged_recording_names_what_is_wrong(tmp_path) -> None:
    folder = tmp_path / "frames"
    recorded(folder)
    (folder / "frames" / "000004.jpg").unlink()
    with pytest.raises(StreamError, match="frame 4 is missing"):
        FrameRecording(folder).frame(4, 0.0)
    lines = (folder / "trajectory.txt").read_text().splitlines()
    (folder / "trajectory.txt").write_text("\n".join(lines[:-1]) + "\n")
    with pytest.raises(StreamError, match=r"scans\.npz does not hold"):
        FrameRecording(folder)
    (folder / "recording.json").write_text("{}")
    with pytest.raises(StreamError, match=r"recording\.json or scans\.npz is damaged"):
        FrameRecording(folder)
    with pytest.raises(StreamError, match="no recording"):
        FrameRecording(tmp_path / "elsewhere")


def test_it_is_sent_by_its_own_clock_to_its_end(tmp_path) -> None:
    recorded(tmp_path / "frames")
    said, clock = [], RobotClock(100.0)
    onboard = CarriedCamera(FrameRecording(tmp_path / "frames"), clock, name="a recording")
    with (
        FakeService(credits=100).serving() as service,
        running(service.url, onboard, said, clock=clock) as robot,
    ):
        assert robot.join() is Outcome.ENDED
        (hello,) = service.of(Hello)
        assert (hello.robot, hello.report) == (None, None)
        times = [frame.time_s for frame in service.of(Frame)]
        np.testing.assert_allclose(np.diff(times), 0.25, atol=1e-6)
        assert len(times) == 9
        assert service.of(Bye)[0].reason == "the recording is over"
        assert service.refused == []
    assert robot.client.ending == "the stream is over"


def test_a_recording_that_breaks_off_says_so(tmp_path) -> None:
    recorded(tmp_path / "frames")
    (tmp_path / "frames" / "frames" / "000002.png").unlink()
    said, clock = [], RobotClock()
    onboard = CarriedCamera(FrameRecording(tmp_path / "frames"), clock, name="a recording")
    with FakeService().serving() as service, running(service.url, onboard, said, clock=clock) as robot:
        robot.join()
        assert service.of(Bye)[0].reason == "the recording is damaged"
    assert "frame 2 is missing" in str(onboard.error)
