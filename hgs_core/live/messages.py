"""What a robot and the service say to each other: MessagePack maps whose `type` names the message.

The robot speaks first (`Hello`), then sends `Frame`s and, at least every half second, a `Report`. It is
answered by a `Welcome`, an `Answer` to every frame, a `Heartbeat` every half second, and commands
(`FollowPath`, `Stop`, `LimitSpeed`), to each of which it says `Ack`.

Units are metres, seconds and radians. Every side has its own clock: `time_s` is the robot's, `now_s` the
service's; neither is compared with the other.
"""

from __future__ import annotations

from typing import Any, Final, Literal

import msgspec

from hgs_core.errors import StreamError

PROTOCOL: Final = 1
FORMATS: Final = {"colour": ("jpeg", "png"), "depth": ("png", "zstd")}


class _Message(msgspec.Struct, kw_only=True, frozen=True, tag_field="type", forbid_unknown_fields=True):
    pass


class LensFacts(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """How a lens bends rays: the models and coefficients of ROS's CameraInfo (`hgs_core.geometry.lens`)."""

    model: str = "none"
    coefficients: list[float] = []


class CameraFacts(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """A colour camera, and the depth camera where that is the same."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    """As `CameraIntrinsics`: pixel centres at integer + 0.5."""
    lens: LensFacts = LensFacts()
    range_m: float
    """Farthest z-depth that it measures."""
    mount_height_m: float = 1.0
    """Of the optical centre above the floor; for a robot that drives."""
    frame_interval_s: float = 0.4


class DepthCameraFacts(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """A depth camera that is not the colour camera: its images are aligned with colour's."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    pose: list[float]
    """Its pose in the colour camera, 16 numbers row by row."""
    lens: LensFacts = LensFacts()


class Report(_Message, frozen=True, tag="report"):
    """Where the robot really is, and what it makes of its commands."""

    time_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    path_length_m: float
    """Driven so far."""
    standing: bool
    command: int = 0
    """The newest command that it obeys; 0 = none yet."""
    waypoints_passed: int = 0
    """Of the path that it follows or followed last, taken-up yaws included."""
    arrived: bool = True
    """Whether that path is finished or given up; also before the first."""
    collisions: int = 0
    """Contacts so far, as its bumper counts them."""
    reversing: bool = False


class Hello(_Message, frozen=True, tag="hello"):
    """The robot introduces itself: on every connection, and whenever its clock has jumped."""

    protocol: int
    name: str
    camera: CameraFacts
    robot: dict[str, Any] | None
    """Settings of its drive (`configs/robot`), without which it cannot be sent anywhere; None = a camera that
    somebody carries, or a recording: it is mapped, and no plans are made."""
    depth_camera: DepthCameraFacts | None = None
    """None = depth comes aligned with colour, pixel by pixel."""
    report: Report | None = None
    """Where it is; needed from a robot that drives."""
    scanner_range_m: float = 5.0
    region_m: list[list[float]] | None = None
    """What is to be explored: the box's lower and upper corner in the robot's world frame; None = the
    preset's extent about where it is."""


class ScanPart(msgspec.Struct, kw_only=True, frozen=True, forbid_unknown_fields=True):
    """One turn of a planar scanner; see `Scan`."""

    origin_m: list[float]
    first_bearing_rad: float
    """In the world frame."""
    step_rad: float
    ranges_m: bytes
    """float32, little-endian: 0 = no return, +inf = nothing within range."""


class Frame(_Message, frozen=True, tag="frame"):
    """A colour and a depth image taken at one moment."""

    sequence: int
    """Rises from frame to frame within a connection."""
    time_s: float
    """When it was taken; rises, too."""
    pose: list[float] | None
    """`T_world_camera`, 16 numbers row by row; camera axes x right, y down, z forward. None where the mission
    is to find it (`localisation`)."""
    colour: bytes
    depth: bytes
    colour_format: Literal["jpeg", "png"] = "jpeg"
    depth_format: Literal["png", "zstd"] = "png"
    """`png`: 16 bits, one channel; `zstd`: the same numbers, row by row, little-endian, compressed."""
    depth_scale: float = 1000.0
    """Units of the depth image a metre. 0 means no return, 65535 nothing within range."""
    scan: ScanPart | None = None


class Cloud(_Message, frozen=True, tag="cloud"):
    """One turn of a lidar, for missions that find their poses by it; it costs no credit and has no answer."""

    sequence: int
    """Rises, as a frame's."""
    time_s: float
    points_m: bytes
    """float32, little-endian: x, y, z of every return, in the lidar's frame (x forward, y left, z up)."""


class Ack(_Message, frozen=True, tag="ack"):
    """Whether a command is obeyed."""

    command: int
    accepted: bool
    reason: str = ""


class Bye(_Message, frozen=True, tag="bye"):
    """The stream is over: the mission ends with what it has."""

    reason: str = "the stream is over"


class Welcome(_Message, frozen=True, tag="welcome"):
    protocol: int
    mission: str
    now_s: float
    dead_man_s: float
    """The robot stops by itself when it has heard nothing for so long, and the mission pauses when it has."""
    credits: int
    """So many frames may be on their way without an `Answer`."""


class Heartbeat(_Message, frozen=True, tag="heartbeat"):
    now_s: float


class Answer(_Message, frozen=True, tag="answer"):
    """What became of a frame; it gives its credit back."""

    now_s: float
    sequence: int
    fate: Literal["taken", "dropped", "refused"]
    """`taken`: it is in the map; `dropped`: a newer one overtook it; `refused`: see `reason`."""
    reason: str = ""


class FollowPath(_Message, frozen=True, tag="path"):
    """A new path in place of the one before. A robot that is not near its beginning refuses it."""

    now_s: float
    command: int
    valid_for_s: float
    """A robot that receives it later than so long after `now_s` refuses it."""
    positions_m: list[list[float]]
    yaws_rad: list[float | None]
    """The heading to take up, standing, at a waypoint; None = drive on."""
    headings_rad: list[float] | None
    """For a car: its heading at every waypoint."""
    timed: dict[str, list[float]]
    """When it is where at nominal speed: columns `t_s`, `x_m`, `y_m`, `yaw_rad`, `speed_mps`,
    `curvature_1pm` (see `TimedPath`)."""


class Stop(_Message, frozen=True, tag="stop"):
    """Stand as fast as the brakes allow, and drop the path."""

    now_s: float
    command: int
    reason: str


class LimitSpeed(_Message, frozen=True, tag="limit_speed"):
    now_s: float
    command: int
    max_speed_mps: float | None
    """None = as fast as it can."""


class Refusal(_Message, frozen=True, tag="refusal"):
    """A message that was not understood or not accepted; it changes nothing."""

    now_s: float
    reason: str


class End(_Message, frozen=True, tag="end"):
    """The mission is over: stand, and go."""

    now_s: float
    reason: str


FromRobot = Hello | Frame | Cloud | Report | Ack | Bye
ToRobot = Welcome | Heartbeat | Answer | FollowPath | Stop | LimitSpeed | Refusal | End

_ENCODER: Final = msgspec.msgpack.Encoder()
_FROM_ROBOT: Final = msgspec.msgpack.Decoder(FromRobot)
_TO_ROBOT: Final = msgspec.msgpack.Decoder(ToRobot)


def encoded(message: FromRobot | ToRobot) -> bytes:
    return _ENCODER.encode(message)


def from_robot(content: bytes) -> FromRobot:
    """Raises `StreamError` naming what is wrong."""
    return _decoded(_FROM_ROBOT, content)


def to_robot(content: bytes) -> ToRobot:
    """Raises `StreamError` naming what is wrong."""
    return _decoded(_TO_ROBOT, content)


def _decoded(decoder: msgspec.msgpack.Decoder, content: bytes) -> Any:
    try:
        return decoder.decode(content)
    except (msgspec.DecodeError, RecursionError) as error:
        raise StreamError(f"not a message of protocol {PROTOCOL}: {error}") from error
