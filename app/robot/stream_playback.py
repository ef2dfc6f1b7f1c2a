"""A recorded stream (TUM folder, MCAP file) as a camera that is carried along."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from app.robot.telling import camera_facts, depth_camera_facts
from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.images import encoded_colour, encoded_depth
from hgs_core.live.messages import PROTOCOL, Frame, Hello
from hgs_core.live.poses import numbers_of
from hgs_core.sensing.raw_frame import FrameSource, RawFrame


class StreamPlayback:
    """Implements `Playback`. Lenses and cameras stay as they are: the service undoes and aligns them."""

    def __init__(
        self,
        source: FrameSource,
        *,
        range_m: float,
        speed: float,
        colour_format: str = "jpeg",
        depth_format: str = "zstd",
        with_poses: bool = True,
    ) -> None:
        """`range_m`: what is farther counts as not measured. `with_poses`: tell the poses that it has."""
        self._source = source
        self._range_m = range_m
        self._speed = speed
        self._formats = colour_format, depth_format
        self._with_poses = with_poses
        self._frames: Iterator[RawFrame] = iter(source)
        self._first = next(iter(source), None)
        if self._first is None:
            raise StreamError(f"{source.name} holds no frame that could be played")
        self._newest: RawFrame | None = None

    @property
    def timestamps_s(self) -> Float[ndarray, " n_frames"]:
        return self._source.timestamps_s

    def hello(self, name: str) -> Hello:
        assert self._first is not None
        colour, depth = self._first.colour_camera, self._first.depth_camera
        intervals = np.diff(self.timestamps_s)
        interval_s = float(np.median(intervals)) / self._speed if len(intervals) else 1.0
        return Hello(
            protocol=PROTOCOL,
            name=name,
            camera=camera_facts(colour, range_m=self._range_m, frame_interval_s=interval_s),
            depth_camera=depth_camera_facts(depth, colour, self._first.T_colour_depth),
            robot=None,
        )

    def frame(self, index: int, time_s: float) -> Frame:
        raw = self._read(index)
        colour_format, depth_format = self._formats
        pose = raw.T_world_camera
        return Frame(
            sequence=index,
            time_s=time_s,
            pose=None if pose is None or not self._with_poses else numbers_of(pose),
            colour=encoded_colour(raw.rgb, image_format=colour_format),
            depth=encoded_depth(raw.depth_m, depth_format=depth_format),
            colour_format="jpeg" if colour_format == "jpeg" else "png",
            depth_format="zstd" if depth_format == "zstd" else "png",
        )

    def pose(self, index: int) -> SE3 | None:
        return None if self._newest is None else self._newest.T_world_camera

    def _read(self, index: int) -> RawFrame:
        for raw in self._frames:
            if raw.sequence == index:
                self._newest = raw
                return raw
        raise StreamError(f"{self._source.name}: frame {index} is missing")
