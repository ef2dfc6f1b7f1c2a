"""A recording that is sent as if it happened now."""

import json

import numpy as np
import pytest
from PIL import Image

import app.robot.replay as program
from app.robot.outcome import MissionWord, Outcome
from app.robot.replay import ReplayOptions, run_replay
from app.robot.stream_playback import StreamPlayback
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.images import decoded_colour, decoded_depth
from hgs_core.live.messages import Bye, Frame, Hello
from hgs_core.live.poses import pose_of
from hgs_core.sensing.recording import open_recording
from tests.app.robot.fake_service import FakeService
from tests.app.robot.robots import in_a_thread

N_FRAMES = 6


@pytest.fixture
def recording(tmp_path):
    """Six frames, a tenth of a second apart, the camera moving along x; the third has no pose."""
    folder = tmp_path / "recording"
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    rng = np.random.default_rng(3)
    for k in range(N_FRAMES):
        Image.fromarray(rng.integers(0, 255, (12, 16, 3), dtype=np.uint8)).save(folder / f"rgb/{k}.png")
        Image.fromarray(np.full((12, 16), 1000 + k, np.uint16)).save(folder / f"depth/{k}.png")
    times = [f"{0.1 * k:.1f}" for k in range(N_FRAMES)]
    for name in ("rgb", "depth"):
        lines = [f"{time} {name}/{k}.png\n" for k, time in enumerate(times)]
        (folder / f"{name}.txt").write_text("".join(lines))
    poses = [f"{time} {0.2 * k} 0 1 0 0 0 1\n" for k, time in enumerate(times) if k != 2]
    (folder / "groundtruth.txt").write_text("".join(poses))
    facts = {"width": 16, "height": 12, "fx": 12.0, "fy": 12.0, "cx": 8.0, "cy": 6.0, "depth_scale": 1000}
    (folder / "intrinsics.json").write_text(json.dumps(facts))
    return folder


@pytest.fixture
def service(monkeypatch):
    """A fake one; what is asked of it over HTTP is answered here."""
    with FakeService().serving() as fake:

        class Api:
            def __init__(self, server, token):
                assert server == "http://service"

            def create_live_mission(self, *, preset, seed, overrides):
                fake.ordered = (preset, seed, overrides)
                return "m1"

            def start(self, mission):
                assert mission == "m1"

            def mission(self, mission):
                return {"state": "running", "reason": "it runs"}

            def ingest_url(self, mission):
                return fake.url

        monkeypatch.setattr(program, "ServiceApi", Api)
        monkeypatch.setattr("app.robot.mission.mission_word", lambda detail: MissionWord())
        yield fake


def test_all_of_it_arrives_as_it_was_recorded(recording, service) -> None:
    said: list[str] = []
    options = ReplayOptions(
        source=recording, server="http://service", speed=50.0, every_frame=True, settings={"threads": "1"}
    )
    run = in_a_thread(run_replay, options, said.append)
    assert run.outcome is Outcome.ENDED
    assert (run.n_frames, run.skipped, run.link.sent) == (N_FRAMES, 0, N_FRAMES)
    assert service.ordered == ("best", 0, {"threads": "1"})
    hello, frames = service.of(Hello)[0], service.of(Frame)
    assert (hello.robot, hello.name) == (None, open_recording(recording).name)
    assert hello.camera.frame_interval_s == pytest.approx(0.1 / 50.0)
    camera = RobotCameras.of(hello).colour.intrinsics
    for k, frame in enumerate(frames):
        assert frame.sequence == k
        if k == 2:
            assert frame.pose is None
        else:
            np.testing.assert_allclose(pose_of(frame.pose, "here").translation, [0.2 * k, 0, 1])
        np.testing.assert_allclose(decoded_depth(frame, camera), 1.0 + 1e-3 * k, atol=5e-4)
        assert decoded_colour(frame, camera).shape == (12, 16, 3)
    assert service.of(Bye)[-1].reason == "the recording is over"
    assert service.refused == []


def test_poses_can_be_kept_back(recording) -> None:
    playback = StreamPlayback(open_recording(recording), range_m=5.0, speed=1.0, with_poses=False)
    assert playback.frame(0, 0.0).pose is None
    assert playback.pose(0) is not None
