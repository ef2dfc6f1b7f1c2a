"""What sits where on a robot: its cameras and its scanner, as it tells them at the beginning."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from app.robot.ros.content import read
from app.robot.ros.scans import is_level
from app.robot.ros.topics import LASER_SCAN, RosTopics
from hgs_core.errors import StreamError
from hgs_core.geometry.lens import LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.ros.cameras import CAMERA_INFO, lens_camera
from hgs_core.sensing.ros.transforms import TF_MESSAGE, TransformTree


class Bridge(Protocol):
    """See `Rosbridge`."""

    @property
    def url(self) -> str: ...
    def topics(self) -> dict[str, str]: ...
    def subscribe(
        self, topic: str, schema: str, callback: Callable[[dict[str, Any]], None], *, interval_s: float = 0.0
    ) -> None: ...
    def publisher(self, topic: str, schema: str) -> Callable[[dict[str, Any]], None]: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Fittings:
    colour: LensCamera
    depth: LensCamera
    T_base_camera: SE3
    """Of the colour camera's optical frame."""
    T_colour_depth: SE3
    T_base_laser: SE3 | None


def heard_fittings(
    bridge: Bridge,
    topics: RosTopics,
    base: str,
    *,
    camera_on_base: SE3 | None,
    depth_is_registered: bool,
    patience_s: float,
) -> Fittings:
    """Listen until all is known. `camera_on_base` counts for more than /tf_static.

    Raises `StreamError` naming the topic that nothing is heard of, or what is wrong with it.
    """
    listener = _Listener(bridge, patience_s)
    images = topics.images
    infos = (images.colour_info, images.depth_info)
    for topic in dict.fromkeys(infos):
        listener.expect(
            topic, CAMERA_INFO, lambda message, where: (lens_camera(message, where), _frame(message))
        )
    if topics.scan is not None:
        listener.expect(topics.scan, LASER_SCAN, lambda message, _: _frame(message))
    (colour, colour_frame), (depth, depth_frame) = (listener.heard(topic) for topic in infos)
    T_base_camera = camera_on_base or listener.placed(base, colour_frame)
    T_base_laser = None if topics.scan is None else listener.placed(base, listener.heard(topics.scan))
    if T_base_laser is not None and not is_level(T_base_laser):
        raise StreamError(
            f"{bridge.url}: the scanner of {topics.scan} is mounted at a tilt: name one that lies level, or "
            "do without by --topic scan=none"
        )
    aligned = depth_is_registered or depth_frame == colour_frame
    return Fittings(
        colour=colour,
        depth=depth,
        T_base_camera=T_base_camera,
        T_colour_depth=SE3.identity() if aligned else listener.placed(colour_frame, depth_frame),
        T_base_laser=T_base_laser,
    )


class _Listener:
    """The first message of each topic, decoded, and the transforms that never change."""

    def __init__(self, bridge: Bridge, patience_s: float) -> None:
        self._bridge = bridge
        self._patience_s = patience_s
        self._news = threading.Condition()
        self._found: dict[str, Any] = {}
        self._tree = TransformTree(offset_s=0.0, gap_s=0.0)
        bridge.subscribe("/tf_static", TF_MESSAGE, self._hear_tf)

    def expect(self, topic: str, schema: str, decode: Callable[[Any, str], Any]) -> None:
        self._bridge.subscribe(topic, schema, partial(self._hear, topic, decode), interval_s=1.0)

    def heard(self, topic: str) -> Any:
        with self._news:
            if not self._news.wait_for(lambda: topic in self._found, self._patience_s):
                raise unheard(self._bridge, topic, self._patience_s)
        if isinstance(found := self._found[topic], StreamError):
            raise found
        return found

    def placed(self, frame: str, sensor: str) -> SE3:
        """A sensor's pose in a frame of the robot."""
        with self._news:
            if self._news.wait_for(lambda: self._tree.is_connected(frame, sensor), self._patience_s):
                placed = self._tree.lookup(frame, sensor, 0.0)
                if placed is not None:
                    return placed
            frames = ", ".join(self._tree.frames) or "nothing"
            wrong = self._found.get("/tf_static")
        raise StreamError(
            f"{self._bridge.url}: /tf_static does not tell where {sensor!r} sits on {frame!r} (it has "
            f"{frames}): start robot_state_publisher, or say it of the camera with --mount"
            + ("" if wrong is None else f". Of what it says, this is wrong: {wrong}")
        )

    def _hear(self, topic: str, decode: Callable[[Any, str], Any], content: dict[str, Any]) -> None:
        if topic in self._found:
            return
        found: Any
        try:
            found = read(content, decode, topic)
        except StreamError as error:
            found = error
        with self._news:
            self._found[topic] = found
            self._news.notify_all()

    def _hear_tf(self, content: dict[str, Any]) -> None:
        with self._news:
            try:
                read(
                    content, lambda message, where: self._tree.add(message, where, static=True), "/tf_static"
                )
            except StreamError as error:
                self._found.setdefault("/tf_static", error)
            self._news.notify_all()


def unheard(bridge: Bridge, topic: str, patience_s: float) -> StreamError:
    return StreamError(
        f"{bridge.url}: nothing is heard of {topic} within {patience_s:g} s: does its driver run?"
    )


def _frame(message: Any) -> str:
    return str(message.header.frame_id)
