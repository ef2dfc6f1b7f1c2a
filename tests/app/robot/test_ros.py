"""A ROS 2 robot behind a rosbridge server: what it tells goes to the mission, paths come back to it."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from app.robot.clock import RobotClock
from app.robot.ros.topics import RosTopicOptions, chosen_topics
from hgs_core.errors import ConfigError, StreamError
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.images import decoded_colour, decoded_depth
from hgs_core.live.messages import Bye, Frame, Hello, Report, Stop
from hgs_core.live.poses import pose_of
from hgs_core.robot.vehicle import robot_config
from tests.app.robot.fake_rosbridge import CAMERA, DRIVE, MOUNT_M, N_RAYS, TYPES, FakeRosRobot
from tests.app.robot.fake_service import FakeService
from tests.app.robot.robots import running, scene

pytest.importorskip("roslibpy", reason="the extra `ros` is not installed")

from app.robot.ros.bridge import Rosbridge
from app.robot.ros.ros_robot import RosRobot, RosRobotOptions

OPTIONS = RosRobotOptions(name="a ROS robot", drive=DRIVE, frame_interval_s=0.1)


@pytest.fixture
def robot():
    with FakeRosRobot(scene()).serving() as fake:
        yield fake


@pytest.fixture
def bridge(robot):
    bridge = Rosbridge(robot.url)
    yield bridge
    bridge.close()


@pytest.fixture
def service():
    with FakeService().serving() as fake:
        yield fake


@pytest.fixture
def connected(bridge, service):
    said: list[str] = []
    clock = RobotClock()
    onboard = RosRobot(bridge, OPTIONS, clock, said.append)
    with running(service.url, onboard, said, clock=clock) as run:
        service.wait_for(lambda: service.of(Report))
        yield run


def until_driving(robot: FakeRosRobot, x_m: float) -> None:
    deadline = time.monotonic() + 30
    while robot.pose.x_m < x_m:
        assert time.monotonic() < deadline, robot.pose
        time.sleep(0.01)


def test_it_introduces_itself_with_what_the_robot_tells(connected, service):
    hello = service.of(Hello)[0]
    assert (hello.camera.width, hello.camera.height) == (CAMERA.width, CAMERA.height)
    assert (hello.camera.fx, hello.camera.cx) == pytest.approx((CAMERA.fx, CAMERA.cx))
    assert hello.camera.mount_height_m == pytest.approx(MOUNT_M[1])
    assert hello.depth_camera is None, "it is aligned"
    assert robot_config(hello.robot) == DRIVE


def test_frames_show_what_the_camera_sees_from_where_it_is(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [0.8, 0.0]]))
    until_driving(robot, 0.5)
    count = len(service.of(Frame))
    service.wait_for(lambda: len(service.of(Frame)) > count + 3)
    cameras = RobotCameras.of(service.of(Hello)[0])
    for frame in service.of(Frame)[-3:]:
        T_world_camera = pose_of(frame.pose, "a frame")
        _, y, z = T_world_camera.translation
        assert z == pytest.approx(MOUNT_M[1])
        assert y == pytest.approx(0.0, abs=0.05)
        rgb, depth_m = scene().caster.render(CAMERA, T_world_camera, 5.0)
        seen = decoded_depth(frame, cameras.depth.intrinsics)
        known = seen > 0
        assert known.mean() > 0.5
        # A moving camera is where odometry was interpolated to, to a few millimetres.
        assert np.median(np.abs(seen - depth_m)[known]) < 0.01
        colour = decoded_colour(frame, cameras.colour.intrinsics)
        assert np.abs(colour.astype(int) - rgb).mean() < 12
    assert robot.pose.x_m > 0.4


def test_scans_are_told_in_the_world(connected, service):
    frame = service.wait_for(lambda: [f for f in service.of(Frame) if f.scan is not None])[-1]
    scan = frame.scan
    ranges = np.frombuffer(scan.ranges_m, "<f4")
    assert len(ranges) == N_RAYS
    bearings = scan.first_bearing_rad + scan.step_rad * np.arange(N_RAYS)
    directions = np.stack([np.cos(bearings), np.sin(bearings), np.zeros(N_RAYS)], axis=1)
    true = scene().caster.cast(np.broadcast_to(scan.origin_m, (N_RAYS, 3)), directions)
    np.testing.assert_allclose(ranges, true, atol=0.01)


def test_a_path_is_driven_and_shown(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [1.0, 0.0], [1.0, 0.8]], yaws_rad=[None, None, math.pi]))
    assert service.ack(1).accepted
    until_driving(robot, 0.3)
    assert not service.report.standing
    service.wait_for(
        lambda: service.report.arrived and service.report.standing and service.report.command == 1
    )
    assert (robot.pose.x_m, robot.pose.y_m) == pytest.approx((1.0, 0.8), abs=0.05)
    assert math.cos(robot.pose.yaw_rad - math.pi) > math.cos(math.radians(3))
    assert service.report.path_length_m == pytest.approx(1.8, abs=0.1)
    path, gone = robot.of("/hgs/path")[-2:]
    assert gone["poses"] == []
    assert path["header"]["frame_id"] == "odom"
    last = path["poses"][-1]["pose"]
    assert (last["position"]["x"], last["position"]["y"]) == (1.0, 0.8)
    assert last["orientation"]["z"] == pytest.approx(1.0)


def test_a_stop_is_obeyed_and_the_path_is_gone(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
    until_driving(robot, 0.4)
    at_m = robot.pose.x_m
    service.say(Stop(now_s=service.now_s(), command=2, reason="a test"))
    assert service.ack(2).accepted
    service.wait_for(lambda: service.report.standing)
    assert robot.pose.x_m < at_m + 0.6  # 1 m/s, braked with 1.5 m/s2, and what the messages take
    service.wait_for(lambda: robot.of("/hgs/path")[-1]["poses"] == [])


def test_a_robot_that_nobody_talks_to_stands(bridge, robot):
    with FakeService(dead_man_s=1.0).serving() as service:
        said: list[str] = []
        clock = RobotClock()
        onboard = RosRobot(bridge, OPTIONS, clock, said.append)
        with running(service.url, onboard, said, clock=clock):
            service.wait_for(lambda: service.of(Report))
            service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
            service.ack(1)
            service.heartbeats = service.answers = False
            service.wait_for(lambda: onboard.dead_man_stops)
            service.wait_for(lambda: not robot.moves)
            assert robot.pose.x_m < 1.9


def test_without_odometry_it_is_told_to_stand_and_says_nothing_of_itself(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
    until_driving(robot, 0.3)
    robot.mute.add("/odom")
    service.wait_for(lambda: robot.of("/cmd_vel")[-1]["linear"]["x"] == 0.0)
    assert robot.pose.x_m < 1.5
    reports = len(service.of(Report))
    time.sleep(1.0)
    assert len(service.of(Report)) <= reports + 1, "what it was is no news"
    robot.mute.clear()
    service.wait_for(lambda: len(service.of(Report)) > reports + 3)
    time.sleep(0.3)
    assert not robot.moves, "it stays until it is told a path again"


def test_odometry_that_comes_a_little_late_still_leads_to_the_goal(connected, robot, service):
    robot.odometry_late_s = 0.15
    time.sleep(0.5)
    service.say(service.path(1, [[0.0, 0.0], [1.0, 0.0], [1.0, 0.8]], yaws_rad=[None, None, math.pi]))
    assert service.ack(1).accepted
    service.wait_for(
        lambda: service.report.arrived and service.report.standing and service.report.command == 1
    )
    assert (robot.pose.x_m, robot.pose.y_m) == pytest.approx((1.0, 0.8), abs=0.08)
    assert math.cos(robot.pose.yaw_rad - math.pi) > math.cos(math.radians(6))


def test_odometry_that_comes_far_too_late_is_none(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
    until_driving(robot, 0.3)
    robot.odometry_late_s = 2.0
    service.wait_for(lambda: not robot.moves)
    assert robot.pose.x_m < 1.5
    time.sleep(3.0)
    assert not robot.moves, "what comes again is two seconds old"
    service.say(service.path(2, [[robot.pose.x_m, 0.0], [2.0, 0.0]]))
    assert not service.ack(2).accepted


def test_a_connection_made_while_odometry_is_silent_is_a_good_one(bridge, robot, service):
    said: list[str] = []
    clock = RobotClock()
    onboard = RosRobot(bridge, OPTIONS, clock, said.append)
    robot.mute.add("/odom")
    time.sleep(1.0)
    with running(service.url, onboard, said, clock=clock):
        service.wait_for(lambda: service.of(Hello))
        robot.mute.clear()
        service.wait_for(lambda: service.of(Report))
        service.wait_for(lambda: service.of(Frame))
        assert service.refused == []


def test_a_path_that_waits_is_not_driven_after_a_silence(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
    until_driving(robot, 0.3)
    robot.mute.add("/odom")
    service.wait_for(lambda: not robot.moves)
    x_m = robot.pose.x_m
    service.say(service.path(2, [[x_m, 0.0], [2.0, 0.0]]))  # the newest odometry still says that it drives
    assert not service.ack(2).accepted
    robot.mute.clear()
    time.sleep(1.0)
    assert robot.pose.x_m == pytest.approx(x_m, abs=0.02)


def test_a_bridge_that_is_lost_comes_back_and_drives_nowhere_by_itself(connected, robot, service):
    service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
    until_driving(robot, 0.3)
    robot.cut()
    service.wait_for(lambda: not robot.moves)
    reports = len(service.of(Report))
    service.wait_for(lambda: len(service.of(Report)) > reports + 3)
    at_m = robot.pose.x_m
    time.sleep(0.5)
    assert robot.pose.x_m == pytest.approx(at_m, abs=0.02)
    service.say(service.path(2, [[at_m, 0.0], [at_m + 0.3, 0.0]]))
    assert service.ack(2).accepted
    service.wait_for(lambda: service.report.arrived and service.report.command == 2)
    assert robot.pose.x_m == pytest.approx(at_m + 0.3, abs=0.05)


@pytest.mark.parametrize(
    ("topic", "spoilt", "says"),
    [
        ("/camera/color/image_raw/compressed", {"data": "no base64!"}, "neither base64 nor bytes"),
        ("/camera/depth/image_rect/compressedDepth", {"format": "16UC1"}, "is no depth"),
        ("/camera/color/image_raw/compressed", {"header": None}, "is not the message that it should be"),
        ("/scan", {"angle_min": None}, "is not the message that it should be"),
    ],
)
def test_a_message_that_is_none_is_named_and_left_out(connected, robot, service, topic, spoilt, says):
    service.wait_for(lambda: service.of(Frame))
    robot.spoil[topic] = lambda content: {**content, **spoilt}
    service.wait_for(lambda: any(says in one and topic in one for one in connected.said))
    robot.spoil.clear()
    count = len(service.of(Frame))
    service.wait_for(lambda: len(service.of(Frame)) > count + 2)


def test_a_clock_that_goes_back_ends_it(connected, robot, service):
    robot.clock_s -= 60.0
    service.wait_for(lambda: service.of(Bye))
    connected.join()
    assert "clock went back" in str(connected.onboard.error)


def test_images_that_never_fit_are_spoken_of(connected, robot, service, monkeypatch):
    monkeypatch.setattr("app.robot.ros.camera._UNPAIRED_S", 1.0)

    def late(content):
        stamp = content["header"]["stamp"]
        return {**content, "header": {**content["header"], "stamp": {**stamp, "sec": stamp["sec"] - 3}}}

    robot.spoil["/camera/depth/image_rect/compressedDepth"] = late
    service.wait_for(lambda: any("max_depth_offset_s" in one for one in connected.said))


def test_a_base_that_takes_other_velocities_is_said(bridge, robot):
    robot.types["/cmd_vel"] = "geometry_msgs/msg/TwistStamped"
    with pytest.raises(StreamError, match=r"TwistStamped.*--velocity-topic"):
        RosRobot(bridge, OPTIONS, RobotClock(), print)


def test_what_the_robot_lacks_is_said(bridge, robot):
    del robot.types["/odom"]
    with pytest.raises(StreamError, match=r"no topic holds nav_msgs/msg/Odometry.*/scan"):
        RosRobot(bridge, OPTIONS, RobotClock(), print)


@pytest.mark.parametrize("topic", ["/odom", "/camera/color/camera_info", "/scan"])
def test_a_driver_that_is_silent_is_named(bridge, robot, topic):
    robot.mute.add(topic)
    with pytest.raises(StreamError, match=f"nothing is heard of {topic}"):
        RosRobot(bridge, replace(OPTIONS, patience_s=1.0), RobotClock(), print)


def test_a_camera_without_its_place_is_said(bridge, robot):
    robot.mute.add("/tf_static")
    with pytest.raises(StreamError, match=r"'optical' sits on 'base_link'.*--mount"):
        RosRobot(bridge, replace(OPTIONS, patience_s=1.0), RobotClock(), print)


def test_an_address_where_nobody_answers_is_said(monkeypatch):
    monkeypatch.setattr("app.robot.ros.bridge._CONNECT_S", 0.5)
    with pytest.raises(StreamError, match=r"no rosbridge server answers at ws://127\.0\.0\.1:9"):
        Rosbridge("ws://127.0.0.1:9")
    with pytest.raises(StreamError, match="no address"):
        Rosbridge("nonsense")


def test_the_fitting_transport_of_each_image_is_chosen():
    found = chosen_topics(TYPES, RosTopicOptions(), source="a robot")
    assert found.images.colour == "/camera/color/image_raw/compressed"
    assert found.images.depth == "/camera/depth/image_rect/compressedDepth"
    assert found.images.colour_info == "/camera/color/camera_info"
    assert (found.odometry, found.scan) == ("/odom", "/scan")
    named = RosTopicOptions(colour="/camera/color/image_raw", scan="none")
    found = chosen_topics(TYPES, named, source="a robot")
    assert found.images.colour == "/camera/color/image_raw"
    assert found.scan is None
    raw = {topic: schema for topic, schema in TYPES.items() if "ompressed" not in topic}
    assert chosen_topics(raw, RosTopicOptions(), source="a robot").images.depth == "/camera/depth/image_rect"
    for unread in (RosTopicOptions(pose="tf"), RosTopicOptions(cloud="/points")):
        with pytest.raises(StreamError, match="an Odometry alone"):
            chosen_topics(TYPES, unread, source="a robot")


def test_the_fake_camera_is_where_the_real_one_would_be(robot):
    """The oracle's own check: the optical frame's quaternion is that of a level camera."""
    from types import SimpleNamespace

    from hgs_core.sensing.ros.poses import transform

    placed = robot._transforms()["transforms"][0]["transform"]
    as_object = SimpleNamespace(
        translation=SimpleNamespace(**placed["translation"]), rotation=SimpleNamespace(**placed["rotation"])
    )
    level = level_camera_pose(MOUNT_M[0], 0.0, MOUNT_M[1], 0.0)
    np.testing.assert_allclose(transform(as_object, "it").as_matrix(), level.as_matrix(), atol=1e-9)


def test_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "roslibpy", None)
    with pytest.raises(ConfigError, match=r"hgs\[ros\]"):
        Rosbridge("ws://127.0.0.1:9090")
