"""`RosCamera`: joins colour, depth, pose and scan of one moment to the frames of a mission."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from app.robot.clock import RobotClock
from app.robot.onboard import Link
from app.robot.ros.content import bytes_of, read
from app.robot.ros.odometry import OdometryTrack
from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.images import encoded_colour, encoded_depth
from hgs_core.live.messages import Frame, ScanPart
from hgs_core.live.poses import numbers_of
from hgs_core.sensing.ros.images import colour_image, depth_image
from hgs_core.sensing.ros.poses import stamp_s

_KEPT: Final = 8
"""Images of each kind that wait for their other half."""
_POSE_S: Final = 1.0
"""An image waits so long for odometry of its time."""
_SCAN_S: Final = 0.3
"""A scan so old still belongs to a frame."""
_LOOK_S: Final = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class _Waiting:
    stamp_s: float
    received_s: float
    content: dict[str, Any]
    where: str


class RosCamera:
    """Hears from one thread, decodes and sends in another, and only what there is a credit for."""

    def __init__(
        self,
        odometry: OdometryTrack,
        clock: RobotClock,
        *,
        T_base_camera: SE3,
        T_base_laser: SE3 | None,
        interval_s: float,
        max_depth_offset_s: float,
        say: Callable[[str], None],
    ) -> None:
        self.skipped = 0
        """Not sent for want of a connection or a credit."""
        self.unread = 0
        """Images and scans that are not what they should be."""
        self._odometry = odometry
        self._clock = clock
        self._T_base_camera = T_base_camera
        self._T_base_laser = T_base_laser
        self._interval_s = interval_s
        self._offset_s = max_depth_offset_s
        self._say = say
        self._colour: deque[_Waiting] = deque(maxlen=_KEPT)
        self._depth: deque[_Waiting] = deque(maxlen=_KEPT)
        self._scan: _Waiting | None = None
        self._sequence = 0
        self._newest_s = -math.inf
        self._complaint = ""
        self._arrived = threading.Condition()
        self._over = False
        self._thread = threading.Thread(target=self._run, name="ros-camera", daemon=True)
        self._link: Link | None = None

    def start(self, link: Link) -> None:
        self._link = link
        self._thread.start()

    def close(self) -> None:
        with self._arrived:
            self._over = True
            self._arrived.notify()
        if self._thread.is_alive():
            self._thread.join()

    def hear_colour(self, content: dict[str, Any], where: str) -> None:
        self._hear(self._colour, content, where)

    def hear_depth(self, content: dict[str, Any], where: str) -> None:
        self._hear(self._depth, content, where)

    def hear_scan(self, content: dict[str, Any], where: str) -> None:
        scan = self._waiting(content, where)
        if scan is not None:
            self._scan = scan

    def _hear(self, into: deque[_Waiting], content: dict[str, Any], where: str) -> None:
        waiting = self._waiting(content, where)
        if waiting is not None:
            with self._arrived:
                into.append(waiting)
                self._arrived.notify()

    def _waiting(self, content: dict[str, Any], where: str) -> _Waiting | None:
        try:
            stamp = read(content, lambda message, _: stamp_s(message.header), where)
        except StreamError as error:
            self._complain(error)
            return None
        return _Waiting(stamp_s=stamp, received_s=self._clock.now_s(), content=content, where=where)

    def _run(self) -> None:
        assert self._link is not None
        while not self._over:
            with self._arrived:
                self._arrived.wait(_LOOK_S)
                pair = None if self._over else self._due()
            if pair is None:
                continue
            if not self._link.may_send_frame():
                self.skipped += 1
                self._newest_s = pair[0].stamp_s
                continue
            try:
                frame = self._frame(*pair)
            except StreamError as error:
                self._complain(error)
                self._newest_s = pair[0].stamp_s
                continue
            if frame is not None:
                self._newest_s = pair[0].stamp_s
                self._link.send_frame(frame, pair[0].received_s)

    def _due(self) -> tuple[_Waiting, _Waiting] | None:
        """The newest colour image that is due, has a depth image, and odometry of its time (or no hope)."""
        odometry = self._odometry.newest
        known_s = -math.inf if odometry is None else odometry.stamp_s
        for colour in reversed(self._colour):
            if colour.stamp_s < self._newest_s + 0.9 * self._interval_s:
                return None
            if colour.stamp_s > known_s and self._clock.now_s() - colour.received_s < _POSE_S:
                continue
            depth = min(self._depth, key=lambda one: abs(one.stamp_s - colour.stamp_s), default=None)
            if depth is not None and abs(depth.stamp_s - colour.stamp_s) <= self._offset_s:
                return colour, depth
        return None

    def _frame(self, colour: _Waiting, depth: _Waiting) -> Frame | None:
        T_world_base = self._odometry.pose_at(colour.stamp_s)
        if T_world_base is None:
            raise StreamError(f"{colour.where}: no odometry of its time: are both stamped by the same clock?")
        depth_m = read(_with_bytes(depth), depth_image, depth.where)
        self._sequence += 1
        return Frame(
            sequence=self._sequence,
            time_s=colour.stamp_s,
            pose=numbers_of(T_world_base @ self._T_base_camera),
            colour=_jpeg(colour),
            depth=encoded_depth(depth_m, depth_format="zstd"),
            depth_format="zstd",
            scan=self._scan_part(colour.stamp_s),
        )

    def _scan_part(self, stamp_s: float) -> ScanPart | None:
        scan = self._scan
        if scan is None or self._T_base_laser is None or abs(scan.stamp_s - stamp_s) > _SCAN_S:
            return None
        T_world_base = self._odometry.pose_at(scan.stamp_s)
        if T_world_base is None:
            return None
        T_world_laser = T_world_base @ self._T_base_laser
        return read(scan.content, lambda message, where: scan_part(message, T_world_laser, where), scan.where)

    def _complain(self, error: StreamError) -> None:
        self.unread += 1
        if str(error) != self._complaint:
            self._complaint = str(error)
            self._say(self._complaint)


def scan_part(message: Any, T_world_laser: SE3, where: str) -> ScanPart:
    """Of a `sensor_msgs/LaserScan` that lies level, the right way up or upside down.

    rosbridge writes what is not finite as null: such a ray may have met nothing, or not have come back, and
    counts as the latter. Raises `StreamError` for angles that are none, and a scanner that is tilted.
    """
    ranges = np.array([np.nan if value is None else value for value in message.ranges], dtype=np.float32)
    known = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
    up = float(T_world_laser.rotation[2, 2])
    if abs(up) < 0.99:
        raise StreamError(f"{where}: the scanner is tilted by {math.degrees(math.acos(up)):.0f} degrees")
    ahead = T_world_laser.rotation[:, 0]
    side = 1.0 if up > 0 else -1.0
    return ScanPart(
        origin_m=T_world_laser.translation.tolist(),
        first_bearing_rad=math.atan2(ahead[1], ahead[0]) + side * float(message.angle_min),
        step_rad=side * float(message.angle_increment),
        ranges_m=np.where(known, ranges, np.float32(0.0)).astype("<f4").tobytes(),
    )


def _with_bytes(image: _Waiting) -> dict[str, Any]:
    return {**image.content, "data": bytes_of(image.content.get("data"), image.where)}


def _jpeg(image: _Waiting) -> bytes:
    """A JPEG goes on as it came."""
    content = _with_bytes(image)
    if "jp" in str(content.get("format", "")):
        return bytes(content["data"])
    return encoded_colour(read(content, colour_image, image.where))
