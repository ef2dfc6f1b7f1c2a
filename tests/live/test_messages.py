"""What travels comes out as it went in, and what breaks the protocol is refused with a reason."""

import math

import msgspec
import numpy as np
import pytest
from backports import zstd
from hypothesis import given, settings
from hypothesis import strategies as st

from hgs_core.errors import StreamError
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.checks import MAX_PIXELS, MessageChecks
from hgs_core.live.images import decoded_colour, decoded_depth, encoded_colour, encoded_depth
from hgs_core.live.messages import (
    PROTOCOL,
    Ack,
    Bye,
    CameraFacts,
    FollowPath,
    Frame,
    Hello,
    Report,
    ScanPart,
    Stop,
    encoded,
    from_robot,
    to_robot,
)
from hgs_core.live.poses import pose_of

CAMERA = CameraFacts(width=8, height=6, fx=6.0, fy=6.0, cx=4.0, cy=3.0, range_m=5.0)
REPORT = Report(time_s=1.0, x_m=1.0, y_m=2.0, yaw_rad=0.5, path_length_m=0.0, standing=True)
HELLO = Hello(protocol=PROTOCOL, name="r2", camera=CAMERA, robot={"drive": "holonomic"}, report=REPORT)
DEPTH = np.array([[0.0, 0.001, 1.5, np.inf, 4.999, 65.0, 80.0, 2.0]] * 6, np.float32)
RGB = np.random.default_rng(0).integers(0, 256, (6, 8, 3), dtype=np.uint8)
SEEN = RobotCameras.of(HELLO).colour.intrinsics
IDENTITY = np.eye(4).reshape(-1).tolist()


def frame(**changes) -> Frame:
    facts = {
        "sequence": 1,
        "time_s": 1.0,
        "pose": IDENTITY,
        "colour": encoded_colour(RGB, image_format="png"),
        "colour_format": "png",
        "depth": encoded_depth(DEPTH),
    }
    return Frame(**{**facts, **changes})


def scan(**changes) -> ScanPart:
    ranges = np.ones(4, "<f4").tobytes()
    facts = {"origin_m": [0.0, 0.0, 0.1], "first_bearing_rad": 0.0, "step_rad": 0.1, "ranges_m": ranges}
    return ScanPart(**{**facts, **changes})


def test_messages_come_out_as_they_went_in() -> None:
    for message in (HELLO, REPORT, frame(scan=scan()), Ack(command=3, accepted=False, reason="no"), Bye()):
        assert from_robot(encoded(message)) == message
    path = FollowPath(
        now_s=1.0,
        command=2,
        valid_for_s=1.0,
        positions_m=[[0.0, 1.0]],
        yaws_rad=[None],
        headings_rad=None,
        timed={"t_s": [0.0]},
    )
    assert to_robot(encoded(path)) == path


@given(st.binary(max_size=200))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_noise_is_refused(content: bytes) -> None:
    with pytest.raises(StreamError, match="protocol"):
        from_robot(content)


@pytest.mark.parametrize(
    "content",
    [
        encoded(Stop(now_s=0, command=1, reason="what the robot is told")),
        msgspec.msgpack.encode({"type": "report", "time_s": "soon"}),
        msgspec.msgpack.encode({"type": "bye", "reason": "x", "more": 1}),
        b"\x93" * 5000,
    ],
)
def test_other_messages_are_refused(content: bytes) -> None:
    with pytest.raises(StreamError):
        from_robot(content)


@pytest.mark.parametrize("depth_format", ["png", "zstd"])
def test_depth_travels_to_the_millimetre(depth_format: str) -> None:
    sent = frame(depth=encoded_depth(DEPTH, depth_format=depth_format), depth_format=depth_format)
    expected = np.where(DEPTH > 65.534, np.float32(np.inf), DEPTH)
    np.testing.assert_allclose(decoded_depth(sent, SEEN), expected, atol=5e-4)
    np.testing.assert_array_equal(decoded_colour(sent, SEEN), RGB)


def test_jpeg_keeps_the_colours_order() -> None:
    red = np.zeros((6, 8, 3), np.uint8)
    red[..., 0] = 255
    got = decoded_colour(frame(colour=encoded_colour(red), colour_format="jpeg"), SEEN)
    assert got[..., 0].min() > 240
    assert got[..., 1:].max() < 20


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"colour": encoded_colour(np.zeros((600, 800, 3), np.uint8), image_format="png")}, "800 x 600"),
        ({"colour": b"not an image"}, "no png"),
        ({"colour": encoded_colour(RGB, image_format="png")[:60]}, "readable|no png"),
        ({"depth": encoded_colour(RGB, image_format="png")}, "16 bit"),
        ({"depth": zstd.compress(bytes(10**8)), "depth_format": "zstd"}, "96 bytes"),
        ({"depth": b"\x28\xb5\x2f\xfd rest", "depth_format": "zstd"}, "no zstd"),
    ],
)
def test_images_that_are_none_are_refused(changes: dict, why: str) -> None:
    """Also a hundred megabytes that were packed into ten kilobytes: they are not unpacked."""
    sent = frame(**changes)
    decode = decoded_depth if "depth" in changes else decoded_colour
    with pytest.raises(StreamError, match=why):
        decode(sent, SEEN)


def turned(degrees: float, scale: float = 1.0, at: float = 0.0) -> list[float]:
    angle = math.radians(degrees)
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    pose[:3, :3] *= scale
    pose[0, 3] = at
    return pose.reshape(-1).tolist()


def test_rigid_poses_are_taken_and_others_are_not() -> None:
    np.testing.assert_allclose(pose_of(turned(30.0, at=2.0), "here").translation, [2.0, 0.0, 0.0])
    mirrored = turned(0.0)
    mirrored[0] = -1.0
    far, nowhere = turned(0, at=1e6), turned(0, at=math.nan)
    for numbers in (turned(0, scale=1.01), far, nowhere, IDENTITY[:12], mirrored):
        with pytest.raises(StreamError, match="here"):
            pose_of(numbers, "here")


def facts(**changes) -> CameraFacts:
    return CameraFacts(**{**msgspec.structs.asdict(CAMERA), **changes})


def changed(message, **changes):
    return msgspec.structs.replace(message, **changes)


@pytest.mark.parametrize(
    ("hello", "why"),
    [
        (changed(HELLO, protocol=2), "protocol 2"),
        (changed(HELLO, name="x" * 500), "name"),
        (changed(HELLO, robot={"drive": "legs"}), "legs"),
        (changed(HELLO, robot={"drive": "holonomic", "radius_m": -1.0}), "radius_m"),
        (changed(HELLO, report=None), "where it is"),
        (changed(HELLO, report=changed(REPORT, x_m=math.nan)), "finite"),
        (changed(HELLO, camera=facts(fx=0.0)), "focal"),
        (changed(HELLO, camera=facts(width=MAX_PIXELS, height=2)), "pixels"),
        (changed(HELLO, camera=facts(range_m=math.inf)), "at most 200"),
        (changed(HELLO, region_m=[[0, 0, 0], [1, 1, 0]]), "above 0"),
        (changed(HELLO, region_m=[[0, 0, 0], [900, 1, 1]]), "at most"),
    ],
)
def test_hellos_that_make_no_robot_are_refused(hello: Hello, why: str) -> None:
    checks = MessageChecks()
    with pytest.raises(StreamError, match=why):
        checks.admit(hello)
    with pytest.raises(StreamError, match="first message"):
        checks.admit(REPORT)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"sequence": 1}, "must rise"),
        ({"sequence": 0}, "must rise"),
        ({"time_s": 1.0}, "clock was set"),
        ({"time_s": math.nan}, "finite"),
        ({"depth_scale": 0.0}, "above 0"),
        ({"colour": b""}, "0 bytes"),
        ({"depth": bytes(10**6)}, "1000000 bytes"),
        ({"pose": turned(0, at=math.inf)}, "finite"),
        ({"scan": scan(origin_m=[0.0, 0.0])}, "origin"),
        ({"scan": scan(ranges_m=np.array([np.nan], "<f4").tobytes())}, "ranges"),
    ],
)
def test_frames_out_of_order_or_out_of_bounds_are_refused(changes: dict, why: str) -> None:
    checks = MessageChecks()
    checks.admit(HELLO)
    checks.admit(frame())
    with pytest.raises(StreamError, match=why):
        checks.admit(frame(**{"sequence": 2, "time_s": 2.0, **changes}))
    checks.admit(frame(sequence=2, time_s=2.0))  # what was refused counts as not sent


def test_a_new_hello_begins_a_new_count() -> None:
    checks = MessageChecks()
    for _ in range(2):
        checks.admit(HELLO)
        checks.admit(frame())
