"""`RosCamera`: joins colour, depth, pose and scan of one moment to the frames of a mission."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from app.robot.clock import RobotClock
from app.robot.onboard import Link
from app.robot.ros.complaints import Complaints
from app.robot.ros.content import bytes_of, read
from app.robot.ros.odometry import OdometryTrack
from app.robot.ros.scans import scan_part
from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.images import encoded_colour, encoded_depth
from hgs_core.live.messages import Frame, ScanPart
from hgs_core.live.poses import numbers_of
from hgs_core.sensing.ros.images import colour_image, depth_image
from hgs_core.sensing.ros.poses import stamp_s

_KEPT_S: Final = 1.5
"""Images wait so long for their other half."""
_POSE_S: Final = 1.0
"""An image waits so long for odometry of its time."""
_UNPAIRED_S: Final = 5.0
"""Images that came for so long without any frame coming of them are spoken of."""
_BACK_S: Final = 1.0
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
        self._odometry = odometry
        self._clock = clock
        self._T_base_camera = T_base_camera
        self._T_base_laser = T_base_laser
        self._interval_s = interval_s
        self._offset_s = max_depth_offset_s
        self._complain = Complaints(say)
        self._colour: deque[_Waiting] = deque()
        self._depth: deque[_Waiting] = deque()
        self._paired_s = math.inf
        """When two images were joined last, or the first one came."""
        self._scan: _Waiting | None = None
        self._sequence = 0
        self._newest_s = -math.inf
        self._arrived = threading.Condition()
        self._over = False
        self._thread = threading.Thread(target=self._run, name="ros-camera", daemon=True)
        self._link: Link | None = None

    @property
    def unread(self) -> int:
        """Images and scans that are not what they should be."""
        return self._complain.count

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
                while into[0].received_s < waiting.received_s - _KEPT_S:
                    into.popleft()
                self._paired_s = min(self._paired_s, waiting.received_s)
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
            if pair is not None:
                self._take(*pair, self._link)

    def _take(self, colour: _Waiting, depth: _Waiting, link: Link) -> None:
        """Send a frame of two images; they are then done with, whatever became of them."""
        self._paired_s = self._clock.now_s()
        if not link.may_send_frame():
            self.skipped += 1
            self._newest_s = colour.stamp_s
            return
        try:
            frame = self._frame(colour, depth)
        except StreamError as error:
            self._complain(error)
        except Exception as error:  # no image, whatever is wrong with it, may end the camera
            self._complain(StreamError(f"{colour.where} and {depth.where} cannot be read: {error!r}"))
        else:
            self._newest_s = colour.stamp_s
            link.send_frame(frame, colour.received_s)
            return
        with self._arrived:
            if colour in self._colour:
                self._colour.remove(colour)

    def _due(self) -> tuple[_Waiting, _Waiting] | None:
        """The newest colour image that is due, has a depth image, and odometry of its time (or no hope)."""
        odometry, now_s = self._odometry.newest, self._clock.now_s()
        known_s = -math.inf if odometry is None else odometry.stamp_s
        for colour in reversed(self._colour):
            if colour.stamp_s < self._newest_s + 0.9 * self._interval_s:
                break
            if colour.stamp_s > known_s and now_s - colour.received_s < _POSE_S:
                continue
            depth = min(self._depth, key=lambda one: abs(one.stamp_s - colour.stamp_s), default=None)
            if depth is not None and abs(depth.stamp_s - colour.stamp_s) <= self._offset_s:
                return colour, depth
        if now_s - self._paired_s > _UNPAIRED_S:
            self._paired_s = now_s
            self._complain(StreamError(self._why_unpaired()))
        return None

    def _why_unpaired(self) -> str:
        if not self._colour or not self._depth:
            return f"no {'depth' if self._colour else 'colour'} image has come for {_UNPAIRED_S:g} s"
        colour, depth = self._colour[-1], self._depth[-1]
        if colour.stamp_s < self._newest_s - _BACK_S:
            return f"{colour.where}: stamped {self._newest_s - colour.stamp_s:.2f} s before the last frame"
        return (
            f"no image of {colour.where} has one of {depth.where} within {self._offset_s:g} s (the newest "
            f"are {abs(depth.stamp_s - colour.stamp_s):.3f} s apart): set --topic max_depth_offset_s"
        )

    def _frame(self, colour: _Waiting, depth: _Waiting) -> Frame:
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
        try:
            return read(scan.content, lambda said, where: scan_part(said, T_world_laser, where), scan.where)
        except StreamError as error:
            self._complain(error)
            self._scan = None
            return None


def _with_bytes(image: _Waiting) -> dict[str, Any]:
    return {**image.content, "data": bytes_of(image.content.get("data"), image.where)}


def _jpeg(image: _Waiting) -> bytes:
    """A JPEG goes on as it came."""
    content = _with_bytes(image)
    if "jp" in str(content.get("format", "")):
        return bytes(content["data"])
    return encoded_colour(read(content, colour_image, image.where))
