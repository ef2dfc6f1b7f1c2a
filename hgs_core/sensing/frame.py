"""What sensors deliver: RGB-D frames and planar scans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray

from hgs_core.errors import SensorError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One RGB-D image with its pose.

    `depth_m` is z-depth: 0 = no return (never carves free space), +inf = nothing within range (carves to
    the sensor's range). Raises `SensorError` when shapes disagree or depth is negative or NaN.
    """

    rgb: UInt8[ndarray, "height width 3"]
    depth_m: Float32[ndarray, "height width"]
    intrinsics: CameraIntrinsics
    T_world_camera: SE3
    timestamp_s: float
    sequence: int
    robot_id: str = "robot0"

    def __post_init__(self) -> None:
        size = (self.intrinsics.height, self.intrinsics.width)
        if self.rgb.shape != (*size, 3) or self.depth_m.shape != size:
            raise SensorError(
                f"frame {self.sequence}: rgb {self.rgb.shape} and depth {self.depth_m.shape} "
                f"do not match the camera's {size}"
            )
        if not bool(np.all(self.depth_m >= 0)):  # false for NaN, too
            raise SensorError(
                f"frame {self.sequence}: depth holds negative or NaN values; use 0 for no return"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """One turn of a planar 360-degree scanner.

    `bearings_rad` are in the world frame about `origin_m`; `ranges_m` follows a frame's depth: 0 = no
    return, +inf = nothing within range.
    """

    origin_m: Float[ndarray, " 3"]
    bearings_rad: Float[ndarray, " n_rays"]
    ranges_m: Float32[ndarray, " n_rays"]
    timestamp_s: float
    robot_id: str = "robot0"
