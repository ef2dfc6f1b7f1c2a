"""The robot at the far end, as the loop drives it: by a clock of the test's own."""

import math

import numpy as np
import pytest

from hgs_core.live.config import LiveConfig
from hgs_core.live.correspondence import Correspondence
from hgs_core.live.images import encoded_depth
from hgs_core.live.messages import (
    Ack,
    Answer,
    Cloud,
    DepthCameraFacts,
    FollowPath,
    Heartbeat,
    Hello,
    LensFacts,
    LimitSpeed,
    Refusal,
    Report,
    Stop,
    Welcome,
    encoded,
    to_robot,
)
from hgs_core.live.world import LiveWorld
from hgs_core.localisation.given import GivenConfig
from hgs_core.localisation.lidar_odometry import LidarOdometryConfig
from hgs_core.localisation.localiser import LocalisationConfig
from hgs_core.localisation.methods import build_localiser
from hgs_core.mission.live import with_robot
from hgs_core.robot.differential import Differential, DifferentialConfig
from hgs_core.robot.path import Path
from tests.live.far_robot import far_config
from tests.live.test_messages import CAMERA, HELLO, REPORT, changed, facts, frame

CONFIG = LiveConfig(dead_man_s=2.0, frame_s=4.0, command_s=1.0, off_path_m=0.5)
AWAY = Path(positions_m=np.array([[1.0, 2.0], [3.0, 2.0]]), yaws_rad=np.array([np.nan, 0.0]))


class Line:
    """A link whose far end is the test; nothing is received by itself."""

    name = "a mission"

    def __init__(self) -> None:
        self.sent: list = []

    def send(self, content: bytes) -> None:
        self.sent.append(to_robot(content))

    def receive(self, timeout_s: float) -> bytes | None:
        return None


class Call:
    """A robot that has said hello, with everything in the test's hand."""

    def __init__(
        self,
        hello: Hello = HELLO,
        localisation: LocalisationConfig = GivenConfig(),
        earlier: dict | None = None,
    ) -> None:
        self.line = Line()
        self.now = 100.0
        self.notices: list[str] = []
        self.correspondence = Correspondence(
            self.line,
            CONFIG,
            localiser_from=lambda start: build_localiser(localisation, start=start),
            earlier=earlier,
            notice=lambda _, message: self.notices.append(message),
            now=lambda: self.now,
        )
        self.say(hello)
        self.world = LiveWorld(self.correspondence, hello, Differential(DifferentialConfig()), CONFIG)
        self.robot = self.world.robot

    def say(self, message) -> None:
        self.correspondence.hear(encoded(message))

    def told(self, kind):
        return [message for message in self.line.sent if isinstance(message, kind)]

    def report(self, **changes) -> None:
        self.say(changed(REPORT, **changes))

    def look(self, sequence: int, time_s: float) -> None:
        """A frame comes, and the loop takes it."""
        self.say(frame(sequence=sequence, time_s=time_s))
        self.world.scan()


@pytest.fixture
def call() -> Call:
    return Call()


def test_a_robot_is_welcomed_and_is_where_it_says(call: Call) -> None:
    (welcome,) = call.told(Welcome)
    assert (welcome.mission, welcome.dead_man_s) == ("a mission", 2.0)
    state = call.robot.state
    assert (state.x_m, state.y_m, state.yaw_rad) == (1.0, 2.0, 0.5)
    assert call.robot.arrived
    call.now += 3.0
    call.report(time_s=2.0, x_m=1.5, path_length_m=0.5, collisions=1)
    state = call.robot.state
    assert (state.x_m, state.path_length_m, state.collisions, state.timestamp_s) == (1.5, 0.5, 1, 3.0)


def test_how_far_it_is_counts_when_a_frame_has_seen_it(call: Call) -> None:
    """It has arrived at 5 s by its clock; a frame of 4 s cannot have seen what is to be seen there."""
    call.robot.follow(AWAY)
    (path,) = call.told(FollowPath)
    assert path.yaws_rad == [None, 0.0]
    assert path.timed["t_s"][-1] == pytest.approx(2.0 + math.degrees(0.5) / 60.0)
    call.say(Ack(command=path.command, accepted=True))
    call.report(time_s=3.0, x_m=2.0, command=path.command, waypoints_passed=1, arrived=False, standing=False)
    call.report(time_s=5.0, x_m=3.0, command=path.command, waypoints_passed=2, arrived=True)
    call.look(1, time_s=4.0)
    assert (call.robot.arrived, call.robot.waypoints_passed) == (False, 1)
    call.look(2, time_s=5.0)
    assert (call.robot.arrived, call.robot.waypoints_passed) == (True, 2)


def test_a_path_that_is_refused_is_over(call: Call) -> None:
    call.robot.follow(AWAY)
    (path,) = call.told(FollowPath)
    call.say(Ack(command=path.command, accepted=False, reason="it begins too far from here"))
    assert call.robot.arrived
    assert "too far" in call.notices[0]
    assert call.told(Stop)[-1].command > path.command


def test_a_path_that_is_not_taken_up_in_time_is_over(call: Call) -> None:
    call.robot.follow(AWAY)
    call.now += 0.9
    call.robot.on_beat()
    assert not call.robot.arrived
    call.now += 0.2
    call.robot.on_beat()
    assert call.robot.arrived
    assert "not taken its path up" in call.notices[0]


def test_a_robot_that_strays_is_stopped(call: Call) -> None:
    call.robot.follow(AWAY)
    (path,) = call.told(FollowPath)
    call.report(time_s=2.0, x_m=2.0, y_m=2.4, command=path.command, arrived=False)
    assert not call.robot.arrived
    call.report(time_s=3.0, x_m=2.0, y_m=2.6, command=path.command, arrived=False)
    assert call.robot.arrived
    assert "0.60 m off its path" in call.notices[0]


def test_it_stands_when_it_says_so_after_it_was_told(call: Call) -> None:
    assert call.robot.standing_in_s == 0.0
    call.robot.follow(AWAY)
    call.report(time_s=2.0, command=1, standing=False, arrived=False)
    call.robot.stop()
    (stop,) = call.told(Stop)
    call.report(time_s=2.1, command=1, standing=True)  # from before it heard
    assert call.robot.standing_in_s == CONFIG.stand_s
    call.report(time_s=2.5, command=stop.command, standing=True)
    assert call.robot.standing_in_s == 0.0


def test_silence_and_blindness_are_reasons_to_wait_until_it_sees_again(call: Call) -> None:
    call.look(1, time_s=1.0)
    assert call.world.why_wait() is None
    call.now += 2.1
    assert "no word" in str(call.world.why_wait())
    call.report(time_s=2.0)
    assert call.world.why_wait() == "waits for a frame"
    call.say(frame(sequence=2, time_s=2.0))
    assert call.world.why_wait() is None
    call.world.scan()
    for time_s in (3.0, 4.0, 5.0):
        call.now += 1.5
        call.report(time_s=time_s)
    assert "no frame" in str(call.world.why_wait())


def test_one_that_is_back_stands_and_is_told_its_speed_again(call: Call) -> None:
    call.robot.limit_speed(0.4)
    call.robot.follow(AWAY)
    call.report(time_s=2.0, command=2, path_length_m=3.0, collisions=1, arrived=False)
    call.say(changed(HELLO, report=changed(REPORT, path_length_m=0.0)))
    assert call.robot.arrived
    assert [limit.max_speed_mps for limit in call.told(LimitSpeed)] == [0.4, 0.4]
    call.report(time_s=3.0, path_length_m=0.5, collisions=0)
    assert (call.robot.state.path_length_m, call.robot.state.collisions) == (3.5, 1)
    assert "is back" in call.notices[0]


def test_another_robot_cannot_take_its_place(call: Call) -> None:
    call.say(changed(HELLO, robot={"drive": "differential"}))
    assert "another robot" in call.told(Refusal)[0].reason


def test_frames_are_answered(call: Call) -> None:
    call.say(frame(sequence=1, time_s=1.0))
    call.say(frame(sequence=2, time_s=2.0))
    call.say(frame(sequence=3, time_s=3.0, colour=b"torn"))
    call.say(frame(sequence=4, time_s=4.0, pose=None))
    call.world.scan()
    call.world.mapped(call.world.capture())
    answers = {(answer.sequence, answer.fate) for answer in call.told(Answer)}
    assert answers == {(1, "dropped"), (2, "taken"), (3, "refused"), (4, "refused")}
    assert call.correspondence.take_dropped() == 1
    assert not call.told(Heartbeat)  # nobody has begun it


def test_a_mission_that_goes_on_counts_on(call: Call) -> None:
    call.robot.follow(AWAY)
    call.report(time_s=2.0, path_length_m=4.0)
    call.look(1, time_s=2.0)
    call.now += 7.0
    kept = call.world.state()
    later = Call(earlier=kept["correspondence"])
    later.world.restore(kept)
    assert later.robot.state.timestamp_s == pytest.approx(7.0)
    later.report(time_s=1.0, path_length_m=1.0)
    assert later.robot.state.path_length_m == pytest.approx(5.0)
    later.robot.follow(AWAY)
    assert later.told(FollowPath)[0].command > call.told(FollowPath)[0].command
    assert isinstance(later.correspondence.report, Report)
    assert later.correspondence.state()["located"] is not None


def test_a_lens_is_undone_and_another_depth_camera_aligned(call: Call) -> None:
    """A pincushion lens, and a depth camera of half the pixels beside it: frames are those of one pinhole."""
    lens = LensFacts(model="plumb_bob", coefficients=[0.6, 0.0, 0.0, 0.0])
    beside = np.eye(4)
    beside[0, 3] = 0.05
    depth = DepthCameraFacts(
        width=4, height=3, fx=3.0, fy=3.0, cx=2.0, cy=1.5, pose=beside.reshape(-1).tolist()
    )
    hello = changed(HELLO, camera=facts(lens=lens), depth_camera=depth)
    other = Call(hello)
    wall = np.full((3, 4), 2.0, np.float32)
    other.say(frame(depth=encoded_depth(wall)))
    other.world.scan()
    seen = other.world.capture()
    assert seen.rgb.shape == (6, 8, 3)
    assert seen.intrinsics.fx > CAMERA.fx
    assert set(np.unique(seen.depth_m)) <= {np.float32(0.0), np.float32(2.0)}
    assert (seen.depth_m == 2.0).mean() > 0.1
    assert with_robot(far_config(), hello).sensor.camera.intrinsics() == seen.intrinsics


def test_a_pose_that_cannot_be_is_refused_and_said_so(call: Call) -> None:
    """Ten metres within a tenth of a second; the next good frame is taken as if nothing had been."""
    call.say(frame(sequence=1, time_s=1.0))
    jumped = np.eye(4)
    jumped[0, 3] = 10.0
    call.say(frame(sequence=2, time_s=1.1, pose=jumped.reshape(-1).tolist()))
    call.say(frame(sequence=3, time_s=1.2))
    refused = [answer for answer in call.told(Answer) if answer.fate == "refused"]
    assert [answer.sequence for answer in refused] == [2]
    assert "at most" in refused[0].reason
    call.world.scan()
    assert call.world.capture().sequence == 3
    call.say(changed(HELLO, report=changed(REPORT, x_m=10.0)))  # it was carried, and says so
    call.say(frame(sequence=1, time_s=1.3, pose=jumped.reshape(-1).tolist()))
    call.world.scan()
    assert call.world.capture().T_world_camera.translation[0] == 10.0


def test_a_lidar_tells_where_frames_were_taken() -> None:
    """Clouds of a room, seen from places 0.1 m apart; the frames have no poses."""
    hello = changed(HELLO, robot=None, report=None)
    call = Call(hello, LidarOdometryConfig(voxel_size_m=0.1))
    rng = np.random.default_rng(0)
    room = rng.uniform([-3, -2, -1], [3, 2, 1], (12_000, 3))
    wall = rng.integers(0, 3, len(room))
    room[np.arange(len(room)), wall] = np.sign(room[np.arange(len(room)), wall]) * np.array([3, 2, 1])[wall]
    for k in range(5):
        points = (room - [0.1 * k, 0.0, 0.0]).astype("<f4")
        call.say(Cloud(sequence=k, time_s=0.1 * k, points_m=points.tobytes()))
        call.say(frame(sequence=k, time_s=0.1 * k + 0.001, pose=None))
    call.world.scan()
    moved = call.world.capture().T_world_camera.translation
    np.testing.assert_allclose(moved, [0.4, 0.0, hello.camera.mount_height_m], atol=0.03)


def test_a_new_limit_of_speed_leaves_the_path_under_way(call: Call) -> None:
    """The robot then reports the limit's number; what it says of its path still counts."""
    call.robot.follow(AWAY)
    (path,) = call.told(FollowPath)
    call.say(Ack(command=path.command, accepted=True))
    call.robot.limit_speed(0.5)
    newest = call.told(LimitSpeed)[0].command
    call.report(time_s=2.0, x_m=2.0, command=newest, waypoints_passed=1, arrived=False, standing=False)
    call.look(1, time_s=2.0)
    assert (call.robot.arrived, call.robot.waypoints_passed) == (False, 1)
    call.report(time_s=3.0, x_m=3.0, command=newest, waypoints_passed=2, arrived=True)
    call.look(2, time_s=3.0)
    assert call.robot.arrived
    assert call.robot.standing_in_s == 0.0


def test_nobody_drives_where_nobody_looks(call: Call) -> None:
    call.look(1, time_s=1.0)
    call.robot.follow(AWAY)
    call.report(time_s=2.0, command=1, arrived=False, standing=False)
    call.now += CONFIG.frame_s + 0.1
    call.robot.on_beat()
    assert call.robot.arrived
    assert "no frame has been looked at" in call.notices[0]


def test_mission_time_stands_still_in_a_pause(call: Call) -> None:
    call.now += 5.0
    with call.correspondence.time.paused():
        call.now += 60.0
        assert call.correspondence.time_s == pytest.approx(5.0)
    call.now += 1.0
    assert call.correspondence.time_s == pytest.approx(6.0)


def test_what_it_drove_before_the_mission_does_not_count() -> None:
    call = Call(changed(HELLO, report=changed(REPORT, path_length_m=30.0, collisions=2)))
    call.report(time_s=2.0, path_length_m=31.0, collisions=2)
    assert (call.robot.state.path_length_m, call.robot.state.collisions) == (1.0, 0)


def test_one_whose_hello_is_refused_is_not_listened_to(call: Call) -> None:
    call.say(changed(HELLO, robot={"drive": "differential"}))
    call.report(time_s=9.0, x_m=50.0)
    assert call.robot.state.x_m == 1.0
    assert "first message" in call.told(Refusal)[-1].reason


def test_a_refused_frame_is_named_when_none_comes(call: Call) -> None:
    call.look(1, time_s=1.0)
    call.say(frame(sequence=2, time_s=2.0, pose=None))
    for time_s in (3.0, 4.0, 5.0):
        call.now += 1.5
        call.report(time_s=time_s)
    assert "has no pose" in str(call.world.why_wait())
