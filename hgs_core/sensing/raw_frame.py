"""RGB-D images as streams deliver them: with lenses, of different sizes, and with a pose or none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8
from numpy import ndarray

from hgs_core.errors import SensorError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.frame import Frame


@dataclass(frozen=True, kw_only=True, eq=False)
class RawFrame:
    """A decoded colour image, and the depth image that was taken with it.

    Depth is z-depth in the depth camera, 0 and +inf as in `Frame`. Raises `SensorError` when an image has
    not the size of its camera.
    """

    rgb: UInt8[ndarray, "height width 3"]
    depth_m: Float32[ndarray, "rows columns"]
    colour_camera: LensCamera
    depth_camera: LensCamera
    T_colour_depth: SE3
    """Where the depth camera stands in the colour camera."""
    T_world_camera: SE3 | None
    """Of the colour camera; None where the stream does not tell."""
    timestamp_s: float
    sequence: int
    robot_id: str = "robot0"

    def __post_init__(self) -> None:
        for name, shape, camera in (
            ("colour", self.rgb.shape[:2], self.colour_camera.intrinsics),
            ("depth", self.depth_m.shape, self.depth_camera.intrinsics),
        ):
            if shape != (camera.height, camera.width):
                raise SensorError(
                    f"frame {self.sequence}: the {name} image measures {shape[1]} x {shape[0]} pixels, "
                    f"its camera {camera.width} x {camera.height}"
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class AlignedFrame:
    """Colour and depth of one pinhole camera; what a `Rectifier` makes of a `RawFrame`."""

    rgb: UInt8[ndarray, "height width 3"]
    depth_m: Float32[ndarray, "height width"]
    intrinsics: CameraIntrinsics
    T_world_camera: SE3 | None
    timestamp_s: float
    sequence: int
    robot_id: str = "robot0"

    def at(self, T_world_camera: SE3) -> Frame:
        """The frame that the mapper takes, seen from this pose."""
        return Frame(
            rgb=self.rgb,
            depth_m=self.depth_m,
            intrinsics=self.intrinsics,
            T_world_camera=T_world_camera,
            timestamp_s=self.timestamp_s,
            sequence=self.sequence,
            robot_id=self.robot_id,
        )


@runtime_checkable
class FrameSource(Protocol):
    """A recording: colour images with their depth, in order of time. Iterating reads them one by one, and may
    be done again and again.

    Frames are numbered from 0 (`RawFrame.sequence`) as `timestamps_s` and `is_posed` are.
    """

    @property
    def name(self) -> str:
        """What it is called in messages and reports."""
        ...

    @property
    def timestamps_s(self) -> Float[ndarray, " n_frames"]:
        """Of the colour images, strictly increasing."""
        ...

    @property
    def is_posed(self) -> Bool[ndarray, " n_frames"]:
        """Which frames come with a pose."""
        ...

    @property
    def n_unmatched(self) -> int:
        """Colour images that are left out, because no depth image was taken near enough in time."""
        ...

    @property
    def pose_origin(self) -> str:
        """Where its poses are from, or why there are none: for messages."""
        ...

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[RawFrame]:
        """Raises `StreamError` naming what cannot be read."""
        ...


def nearest_index(times_s: Float[ndarray, " n"], time_s: float, at_most_s: float) -> int | None:
    """Which of the sorted `times_s` is nearest to `time_s`, the earlier of two as near; None if none is
    within `at_most_s`."""
    after = int(np.searchsorted(times_s, time_s))
    near = [k for k in (after - 1, after) if 0 <= k < len(times_s)]
    if not near:
        return None
    nearest = min(near, key=lambda k: abs(float(times_s[k]) - time_s))
    return nearest if abs(float(times_s[nearest]) - time_s) <= at_most_s else None
