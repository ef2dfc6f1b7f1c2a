"""MCAP recordings of an RGB-D camera as frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from hgs_core.errors import SensorError, StreamError
from hgs_core.geometry.lens import LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.mcap_file import McapFile, StoredMessage
from hgs_core.sensing.raw_frame import RawFrame, nearest_index
from hgs_core.sensing.ros.cameras import lens_camera
from hgs_core.sensing.ros.images import colour_image, depth_image, is_depth
from hgs_core.sensing.ros.poses import ODOMETRY, StampedPoses, pose, stamp_s
from hgs_core.sensing.ros.topics import TF, TopicChoice, TopicOptions, Topics
from hgs_core.sensing.ros.transforms import TF_MESSAGE, TransformTree

_WORLD_FRAMES: Final = ("map", "odom", "world")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pair:
    """A colour image and its depth image: numbers of messages in their topics."""

    colour: int
    depth: int
    time_s: float
    T_world_camera: SE3 | None


class McapRecording:
    """A `FrameSource`: colour, depth, calibration and poses of an MCAP file with ROS 2 messages.

    Times are those of the headers. Each colour image is joined with the depth image nearest in time
    (`TopicOptions.max_depth_offset_s`); those without are left out. Opening reads the whole file once, and
    decodes of the images only their headers. Raises `StreamError` naming file, topic and remedy.
    """

    def __init__(self, path: Path, options: TopicOptions) -> None:
        self._file = McapFile(path)
        self._options = options
        self.name = path.stem
        self._tf = self._read_tf()
        self.topics = self._choose()
        self._colour_frame = self._frame_of(self.topics.colour)
        self._colour_camera = self._camera(self.topics.colour_info)
        self._depth_camera = self._camera(self.topics.depth_info)
        self._T_colour_depth = self._place_depth()
        poses = self._poses()
        colours_s, depths_s = (
            self._file.stamps_s(topic) for topic in (self.topics.colour, self.topics.depth)
        )
        joined = [
            (k, nearest_index(depths_s, t, options.max_depth_offset_s)) for k, t in enumerate(colours_s)
        ]
        self._pairs = [
            _Pair(
                colour=k, depth=depth, time_s=float(colours_s[k]), T_world_camera=poses(float(colours_s[k]))
            )
            for k, depth in joined
            if depth is not None
        ]
        self.n_unmatched = len(colours_s) - len(self._pairs)
        if not self._pairs:
            raise StreamError(
                f"{path}: no image of {self.topics.colour} has one of {self.topics.depth} within "
                f"{options.max_depth_offset_s} s; raise max_depth_offset_s, or name another topic"
            )
        self.timestamps_s = np.array([pair.time_s for pair in self._pairs])
        self.is_posed = np.array([pair.T_world_camera is not None for pair in self._pairs])

    @property
    def pose_origin(self) -> str:
        if self.topics.pose is None:
            return f"{self._file.path} has no poses; there are: {self._file.described()}"
        if self.topics.pose == TF:
            return f"poses of {self._file.path} are from tf, {self._world_frame()} to {self._colour_frame}"
        return f"poses of {self._file.path} are from {self.topics.pose}"

    def T_frame_camera(self, frame: str, time_s: float) -> SE3 | None:
        """Where the colour camera stood in that frame; None where tf does not tell."""
        if not self._tf.is_connected(frame, self._colour_frame):
            return None
        return self._tf.lookup(frame, self._colour_frame, time_s)

    def __len__(self) -> int:
        return len(self._pairs)

    def __iter__(self) -> Iterator[RawFrame]:
        colours, depths = self.topics.colour, self.topics.depth
        wanted = {
            colours: {pair.colour for pair in self._pairs},
            depths: {pair.depth for pair in self._pairs},
        }
        held: dict[tuple[str, int], StoredMessage] = {}
        done = 0
        for message in self._file.messages([colours, depths]):
            if message.number in wanted[message.topic]:
                held[message.topic, message.number] = message
            while done < len(self._pairs):
                pair = self._pairs[done]
                colour, depth = held.get((colours, pair.colour)), held.get((depths, pair.depth))
                if colour is None or depth is None:
                    break
                yield self._frame(pair, colour, depth, done)
                done += 1
                self._let_go(held, done)

    def _let_go(self, held: dict[tuple[str, int], StoredMessage], done: int) -> None:
        """Drop the images that no pair from `done` on needs: they are in order."""
        if done == len(self._pairs):
            held.clear()
            return
        pair = self._pairs[done]
        needed = {self.topics.colour: pair.colour, self.topics.depth: pair.depth}
        for topic, number in list(held):
            if number < needed[topic]:
                del held[topic, number]

    def _frame(self, pair: _Pair, colour: StoredMessage, depth: StoredMessage, sequence: int) -> RawFrame:
        try:
            return RawFrame(
                rgb=colour_image(self._file.decode(colour), colour.where),
                depth_m=depth_image(self._file.decode(depth), depth.where),
                colour_camera=self._colour_camera,
                depth_camera=self._depth_camera,
                T_colour_depth=self._T_colour_depth,
                T_world_camera=pair.T_world_camera,
                timestamp_s=pair.time_s,
                sequence=sequence,
            )
        except SensorError as error:
            raise StreamError(
                f"{colour.where} and {depth.where}: {error}; name the CameraInfo that belongs to them with "
                f"colour_info (now {self.topics.colour_info}) and depth_info (now {self.topics.depth_info})"
            ) from error

    def _choose(self) -> Topics:
        file = self._file
        choice = TopicChoice(
            {topic.name: topic.schema for topic in file.topics if topic.n_messages > 0},
            source=str(file.path),
            described=file.described(),
            is_depth=lambda topic: is_depth(file.decode(file.first(topic)), file.first(topic).where),
            tf_reaches=self._tf_reaches,
        )
        return choice.choose(self._options)

    def _camera(self, topic: str) -> LensCamera:
        message = self._file.first(topic)
        return lens_camera(self._file.decode(message), message.where)

    def _frame_of(self, topic: str) -> str:
        return str(self._file.decode(self._file.first(topic)).header.frame_id)

    def _read_tf(self) -> TransformTree:
        options = self._options
        tree = TransformTree(offset_s=options.max_pose_offset_s, gap_s=options.max_pose_gap_s)
        topics = [topic.name for topic in self._file.topics if topic.schema == TF_MESSAGE]
        for message in self._file.messages(topics):
            static = message.topic.endswith("tf_static")
            tree.add(self._file.decode(message), message.where, static=static)
        return tree

    def _world_frame(self) -> str | None:
        if self._options.world_frame is not None:
            return self._options.world_frame
        return next((frame for frame in _WORLD_FRAMES if frame in self._tf.frames), None)

    def _tf_reaches(self, colour: str) -> bool:
        world = self._world_frame()
        return world is not None and self._tf.is_connected(world, self._frame_of(colour))

    def _place_depth(self) -> SE3:
        """`T_colour_depth`, which does not change."""
        depth_frame = self._frame_of(self.topics.depth)
        if depth_frame == self._colour_frame or self._options.depth_is_registered:
            return SE3.identity()
        if not self._tf.is_connected(self._colour_frame, depth_frame):
            raise StreamError(
                f"{self._file.path}: {self.topics.depth} is of frame {depth_frame!r}, {self.topics.colour} "
                f"of {self._colour_frame!r}, and tf does not tell how they stand: record /tf_static, or set "
                "depth_is_registered where the driver aligned them"
            )
        placed = self._tf.lookup(
            self._colour_frame, depth_frame, self._file.first(self.topics.depth).stamp_s()
        )
        if placed is None:
            raise StreamError(
                f"{self._file.path}: tf has no transform from {depth_frame!r} to {self._colour_frame!r} at "
                "the time of the first depth image: record /tf_static"
            )
        return placed

    def _poses(self) -> Callable[[float], SE3 | None]:
        topic, camera = self.topics.pose, self._colour_frame
        if topic is None:
            return lambda time_s: None
        if topic == TF:
            world = self._world_frame()
            if world is None:
                raise StreamError(
                    f"{self._file.path}: tf has none of the frames {', '.join(_WORLD_FRAMES)}; name one of "
                    f"{', '.join(self._tf.frames) or '(none)'} as world_frame"
                )
            self._tf.lookup(world, camera, 0.0)  # raises where they do not hang together
            return lambda time_s: self._tf.lookup(world, camera, time_s)
        return self._poses_of_topic(topic)

    def _poses_of_topic(self, topic: str) -> Callable[[float], SE3 | None]:
        stamped: list[tuple[float, SE3]] = []
        body = self._options.pose_frame
        for message in self._file.messages([topic]):
            decoded = self._file.decode(message)
            is_odometry = message.schema is not None and message.schema.name == ODOMETRY
            if is_odometry and body is None:
                body = str(decoded.child_frame_id) or None
            given = decoded.pose.pose if is_odometry else decoded.pose
            stamped.append((stamp_s(decoded.header), pose(given, message.where)))
        options = self._options
        track = StampedPoses(stamped, offset_s=options.max_pose_offset_s, gap_s=options.max_pose_gap_s)
        if body is None or body == self._colour_frame:
            return track.at
        if not self._tf.is_connected(body, self._colour_frame):
            raise StreamError(
                f"{self._file.path}: {topic} tells where {body!r} is, and tf does not tell where on it the "
                f"camera {self._colour_frame!r} sits: record /tf_static, or set pose_frame to the camera's"
            )

        def at(time_s: float) -> SE3 | None:
            T_world_body = track.at(time_s)
            T_body_camera = self._tf.lookup(body, self._colour_frame, time_s)
            if T_world_body is None or T_body_camera is None:
                return None
            return T_world_body @ T_body_camera

        return at
