"""What is checked of a robot's messages before anything is done with them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from hgs_core.errors import HgsError, StreamError
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.messages import (
    PROTOCOL,
    Ack,
    Answer,
    Bye,
    CameraFacts,
    Cloud,
    DepthCameraFacts,
    Frame,
    FromRobot,
    Hello,
    Refusal,
    Report,
    ScanPart,
)
from hgs_core.live.poses import FARTHEST_M, pose_of
from hgs_core.robot.vehicle import robot_config

MAX_PIXELS: Final = 4_000_000
MAX_RAYS: Final = 20_000
MAX_POINTS: Final = 250_000
MAX_TEXT: Final = 300
MAX_REGION_M: Final = 200.0
FARTHEST_RANGE_M: Final = 200.0


class MessageChecks:
    """The checks of one connection: they know what came before. Each raises `StreamError`."""

    def __init__(self) -> None:
        self._hello: Hello | None = None
        self._newest: dict[type, tuple[int, float]] = {}
        """Number and time of the newest frame and cloud."""

    def admit(self, message: FromRobot) -> None:
        """Raises `StreamError` for a message that is not to be passed on; it counts as not sent."""
        if isinstance(message, Hello):
            self._hello = None
            self._newest.clear()
            check_hello(message)
            self._hello = message
        elif self._hello is None:
            raise StreamError("the first message must be a hello")
        elif isinstance(message, Frame):
            check_frame(message, self._hello)
            self._check_order(message, "frame")
        elif isinstance(message, Cloud):
            _check_cloud(message)
            self._check_order(message, "cloud")
        elif isinstance(message, Report):
            check_report(message)
        elif isinstance(message, Ack | Bye):
            _check_text(message.reason, "reason")

    def _check_order(self, message: Frame | Cloud, what: str) -> None:
        sequence, time_s = self._newest.get(type(message), (-1, -math.inf))
        if message.sequence <= sequence:
            raise StreamError(
                f"{what} {message.sequence} comes after {what} {sequence}: numbers must rise, and an older "
                "one is of no use"
            )
        if message.time_s <= time_s:
            raise StreamError(
                f"{what} {message.sequence} was taken at {message.time_s} s, the one before at {time_s} s: "
                "say hello again if the clock was set"
            )
        self._newest[type(message)] = (message.sequence, message.time_s)


def refusal_of(message: FromRobot | None, reason: str, *, now_s: float) -> Answer | Refusal:
    """What the robot is told of a message that is not passed on; a frame's credit goes back to it."""
    if isinstance(message, Frame):
        return Answer(now_s=now_s, sequence=message.sequence, fate="refused", reason=reason)
    return Refusal(now_s=now_s, reason=reason)


def check_hello(hello: Hello) -> None:
    if hello.protocol != PROTOCOL:
        raise StreamError(f"protocol {hello.protocol} is not spoken here: this is protocol {PROTOCOL}")
    _check_text(hello.name, "name")
    _check_cameras(hello)
    if not (_finite([hello.scanner_range_m]) and 0 < hello.scanner_range_m <= FARTHEST_RANGE_M):
        raise StreamError(f"scanner_range_m {hello.scanner_range_m}: expected a distance above 0")
    if hello.robot is not None:
        try:
            robot_config(hello.robot)
        except (HgsError, ValueError) as error:  # pydantic's ValidationError is a ValueError
            raise StreamError(f"the robot's drive is not understood: {error}") from error
        if hello.report is None:
            raise StreamError("a robot that drives must say where it is: its hello has no report")
    if hello.report is not None:
        check_report(hello.report)
    if hello.region_m is not None:
        _check_region(hello.region_m)


def _check_cameras(hello: Hello) -> None:
    cameras: list[CameraFacts | DepthCameraFacts] = [hello.camera]
    if hello.depth_camera is not None:
        cameras.append(hello.depth_camera)
    for camera in cameras:
        if camera.width * camera.height > MAX_PIXELS:
            raise StreamError(
                f"a camera of {camera.width} x {camera.height} pixels has more than {MAX_PIXELS}: "
                "scale its images"
            )
        if not _finite([camera.fx, camera.fy, camera.cx, camera.cy]):
            raise StreamError(f"a camera needs finite numbers: {camera}")
    facts = hello.camera
    positive = [facts.range_m, facts.mount_height_m, facts.frame_interval_s]
    if not _finite(positive) or min(positive) <= 0 or max(positive) > FARTHEST_RANGE_M:
        raise StreamError(
            f"the camera's distances and intervals must be above 0 and at most {FARTHEST_RANGE_M:g}: {facts}"
        )
    RobotCameras.of(hello)


def check_frame(frame: Frame, hello: Hello) -> None:
    if not _finite([frame.time_s, frame.depth_scale]) or frame.depth_scale <= 0:
        raise StreamError(
            f"frame {frame.sequence}: time_s {frame.time_s} and depth_scale {frame.depth_scale} must be "
            "finite, the scale above 0"
        )
    colour, depth = hello.camera, hello.depth_camera or hello.camera
    for what, content, camera in (("colour", frame.colour, colour), ("depth", frame.depth, depth)):
        # No encoding makes an image larger than this, but one that hides something else.
        most = 4 * camera.width * camera.height + 65_536
        if not 0 < len(content) <= most:
            raise StreamError(f"frame {frame.sequence}: {what} of {len(content)} bytes; expected 1 to {most}")
    if frame.pose is not None:
        pose_of(frame.pose, f"frame {frame.sequence}")
    if frame.scan is not None:
        _check_scan(frame.scan, f"frame {frame.sequence}")


def check_report(report: Report) -> None:
    if not _finite([report.time_s, report.x_m, report.y_m, report.yaw_rad, report.path_length_m]):
        raise StreamError("a report must hold finite numbers")
    if max(abs(report.x_m), abs(report.y_m)) > FARTHEST_M:
        raise StreamError(f"a report from ({report.x_m:.0f}, {report.y_m:.0f}) m: no robot is there")
    if min(report.path_length_m, report.waypoints_passed, report.command, report.collisions) < 0:
        raise StreamError("a report counts its path, waypoints, commands and collisions from 0")


def _check_scan(scan: ScanPart, where: str) -> None:
    if len(scan.origin_m) != 3 or not _finite([*scan.origin_m, scan.first_bearing_rad, scan.step_rad]):
        raise StreamError(f"{where}: a scan needs an origin of 3 finite numbers and finite bearings")
    if max(abs(number) for number in scan.origin_m) > FARTHEST_M:
        raise StreamError(f"{where}: a scan from {scan.origin_m}: no scanner is there")
    if len(scan.ranges_m) % 4 or len(scan.ranges_m) > 4 * MAX_RAYS:
        raise StreamError(f"{where}: a scan has at most {MAX_RAYS} ranges of 4 bytes")
    ranges = np.frombuffer(scan.ranges_m, "<f4")
    if not bool(np.all(ranges >= 0)):  # false for NaN, too
        raise StreamError(f"{where}: a scan's ranges must be 0 or more")


def _check_cloud(cloud: Cloud) -> None:
    where = f"cloud {cloud.sequence}"
    if not _finite([cloud.time_s]):
        raise StreamError(f"{where}: time_s {cloud.time_s} must be finite")
    if len(cloud.points_m) % 12 or len(cloud.points_m) > 12 * MAX_POINTS:
        raise StreamError(f"{where}: at most {MAX_POINTS} points of 12 bytes each")
    if not bool(np.isfinite(np.frombuffer(cloud.points_m, "<f4")).all()):
        raise StreamError(f"{where}: its points must be finite; leave out rays without a return")


def _check_region(region_m: list[list[float]]) -> None:
    if len(region_m) != 2 or any(len(corner) != 3 or not _finite(corner) for corner in region_m):
        raise StreamError("region_m: expected a lower and an upper corner of 3 finite numbers each")
    size = np.subtract(region_m[1], region_m[0])
    if size.min() <= 0 or size.max() > MAX_REGION_M:
        raise StreamError(f"region_m: its sides must be above 0 and at most {MAX_REGION_M:g} m, not {size}")


def _check_text(text: str, what: str) -> None:
    if len(text) > MAX_TEXT or not text.isprintable():
        raise StreamError(f"{what}: expected at most {MAX_TEXT} printable characters")


def _finite(numbers: Iterable[float]) -> bool:
    return all(math.isfinite(number) for number in numbers)
