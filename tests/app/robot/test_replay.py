"""A recording that is sent as if it happened now."""

import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import app.robot.replay as program
from app.cli.application import application
from app.robot.outcome import MissionWord, Outcome
from app.robot.recorded_lidar import cloud_message
from app.robot.replay import ReplayOptions, run_replay
from app.robot.stream_playback import StreamPlayback
from hgs_core.errors import StreamError
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.checks import MAX_POINTS
from hgs_core.live.images import decoded_colour, decoded_depth
from hgs_core.live.messages import Bye, Cloud, Frame, Hello
from hgs_core.live.poses import pose_of
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.recording import open_recording
from tests.app.robot.fake_service import FakeService
from tests.app.robot.robots import in_a_thread
from tests.sensing import bags, walk

N_FRAMES = 6
BY_LIDAR = {"localisation.method": "lidar-odometry"}
MOUNTED = {**BY_LIDAR, "localisation.camera_xyz_m": "[0.0, 0.0, 0.0]"}
CLOUDS_S = (0.06, 0.14, 0.2, 0.34)
"""Of four clouds, beside frames at 0.1, 0.2 and 0.3 s."""


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


def cloud(k: int) -> np.ndarray:
    return np.full((k + 1, 3), k, np.float32)


def drive(folder, *topics: str, clock_s: float = 0.0):
    """Three frames and, on each topic, four clouds, of a clock that is `clock_s` ahead."""

    def add(bag: bags.Bag) -> None:
        walk.add_images(bag, times=(0.1, 0.2, 0.3))
        for topic in topics:
            for k, time_s in enumerate(CLOUDS_S):
                message = bags.point_cloud(time_s + clock_s, cloud(k), names="xyz")
                bag.add(topic, walk.CLOUD, time_s, message)

    return walk.written(folder, add)


def replayed(source, settings, **changes):
    options = ReplayOptions(source=source, server="http://service", settings=settings, **changes)
    return in_a_thread(run_replay, options, lambda _: None)


@pytest.mark.parametrize("waits", [True, False])
def test_clouds_go_out_before_the_frames_that_are_not_older(tmp_path, service, waits) -> None:
    """Waiting for the only credit loses neither; without waiting, frames are skipped, and no cloud is. The
    times between them are those of the recording, though it is played ten times as fast."""
    service.credits, service.answers = 1, waits
    run = replayed(drive(tmp_path, "/velodyne"), MOUNTED, every_frame=waits, speed=10.0)
    heard = [message for message in service.received if isinstance(message, Frame | Cloud)]
    order = [f"{type(message).__name__} {message.sequence}" for message in heard]
    expected = ["Cloud 0", "Frame 0", "Cloud 1", "Cloud 2", "Frame 1", "Frame 2"]
    assert order == (expected if waits else expected[:4])
    times_s = [message.time_s - heard[0].time_s for message in heard]
    np.testing.assert_allclose(
        times_s, np.array([0.0, 0.04, 0.08, 0.14, 0.14, 0.24])[: len(heard)], atol=1e-9
    )
    for message in service.of(Cloud):
        points = np.frombuffer(message.points_m, "<f4").reshape(-1, 3)
        np.testing.assert_array_equal(points, cloud(message.sequence))
    assert (run.link.clouds_sent, run.link.clouds_lost, run.skipped) == (3, 0, 0 if waits else 2)
    assert service.refused == []


def test_clouds_stay_where_no_mission_uses_them_unless_they_are_named(tmp_path, service) -> None:
    path = drive(tmp_path, "/left", "/right")
    assert replayed(path, {}, speed=10.0).link.clouds_sent == 0
    named = ["--mission", "m1", "--topic", "cloud=/right", "--speed", "10"]
    told = in_a_thread(
        CliRunner().invoke, application, ["replay", str(path), "--server", "http://service", *named]
    )
    assert (told.exit_code, "3 clouds sent, 0 lost" in told.output) == (0, True), told.output
    with pytest.raises(StreamError, match=r"2 topics hold .*PointCloud2 \(/left, /right\).*option 'cloud'"):
        replayed(path, MOUNTED)


def test_tf_tells_the_mission_how_the_camera_sits_on_the_lidar(tmp_path, service) -> None:
    """The optical axis looks along the mast's y; the lidar is turned by a quarter of a turn, too."""

    def add(bag: bags.Bag) -> None:
        mounting = bags.transforms(
            0.0,
            ("mast", "lidar", (0.0, 0.0, 0.5), np.pi / 2),
            ("mast", walk.OPTICAL, (0.1, 0.2, 0.25), 0.0),
        )
        half = np.sqrt(0.5)
        mounting["transforms"][1]["transform"]["rotation"] = {"x": -half, "y": 0.0, "z": 0.0, "w": half}
        bag.add("/tf_static", walk.TF, 0.0, mounting)
        walk.add_images(bag)
        bag.add("/velodyne", walk.CLOUD, 0.0, bags.point_cloud(0.0, cloud(0)))

    said: list[str] = []
    path = walk.written(tmp_path, add)
    options = ReplayOptions(source=path, server="http://service", settings=BY_LIDAR, speed=10.0)
    in_a_thread(run_replay, options, said.append)
    _, _, settings = service.ordered
    xyz, rpy = (json.loads(settings[f"localisation.camera_{name}"]) for name in ("xyz_m", "rpy_deg"))
    np.testing.assert_allclose(xyz, [0.2, -0.1, -0.25], atol=1e-6)
    np.testing.assert_allclose(rpy, [0.0, 0.0, 0.0], atol=1e-6)
    assert "localisation.camera_xyz_m=[0.200000, -0.100000, -0.250000], from tf" in said
    replayed(path, MOUNTED, speed=10.0)
    assert service.ordered[2] == MOUNTED  # who says it knows it


@pytest.mark.parametrize(
    ("topics", "clock_s", "settings", "complaint"),
    [
        (["/velodyne"], 0.0, BY_LIDAR, r"frame 'lidar': record /tf_static, or say it with --set"),
        (["/velodyne"], 50.0, MOUNTED, r"/velodyne is of 50\.060 to .* one clock"),
        ([], 0.0, MOUNTED, "no topic holds .*PointCloud2"),
    ],
)
def test_a_lidar_that_cannot_be_used_is_told_of_before_a_mission_is_made(
    tmp_path, service, topics, clock_s, settings, complaint
) -> None:
    service.ordered = None
    with pytest.raises(StreamError, match=complaint):
        replayed(drive(tmp_path, *topics, clock_s=clock_s), settings)
    assert service.ordered is None


def test_a_folder_has_no_clouds(recording, service) -> None:
    with pytest.raises(StreamError, match="in the TUM layout, which has no clouds"):
        replayed(recording, MOUNTED)


def test_a_cloud_has_no_more_points_than_a_message_holds() -> None:
    points = np.zeros((MAX_POINTS + 1, 3), np.float32)
    scan = PointScan(points_m=points, T_world_lidar=None, timestamp_s=0.0, sequence=7)
    with pytest.raises(StreamError, match="cloud 7 has 250001 points, at most 250000 are taken"):
        cloud_message(scan, 0.0)
