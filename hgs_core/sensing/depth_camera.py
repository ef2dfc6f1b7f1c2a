"""The RGB-D camera: its settings and its depth noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float32
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.camera import CameraIntrinsics

_NEAREST_M = 1e-3


class DepthCameraConfig(StrictConfig):
    """An RGB-D camera that looks level, straight ahead, from above the robot's axis."""

    method: str = "rgbd"
    """Which sensor: a name that `sensor_methods()` lists."""
    width: int = Field(1200, ge=1)
    """Image width [pixels]."""
    height: int = Field(680, ge=1)
    """Image height [pixels]."""
    focal_px: float = Field(600.0, gt=0)
    """Focal length [pixels]."""
    focal_y_px: float | None = Field(None, gt=0)
    """Another one along the image's height, where it differs [pixels]."""
    centre_px: tuple[float, float] | None = None
    """Principal point, column and row [pixels]; none: the image's centre."""
    range_m: float = Field(5.0, gt=0)
    """Farthest z-depth that is measured [m]; colours reach further."""
    depth_noise_m: float = Field(0.02, ge=0)
    """Half-width of the uniform error of each depth pixel [m], independent between pixels."""
    mount_height_m: float = Field(1.0, gt=0)
    """Height of the optical centre above the floor [m]."""
    frame_interval_s: float = Field(0.4, gt=0)
    """Time between frames [s]."""

    def intrinsics(self) -> CameraIntrinsics:
        centred = CameraIntrinsics.centred(self.width, self.height, self.focal_px)
        cx, cy = (centred.cx, centred.cy) if self.centre_px is None else self.centre_px
        return replace(centred, fy=self.focal_y_px or self.focal_px, cx=cx, cy=cy)


def with_uniform_noise(
    distance_m: Float32[ndarray, "*shape"], half_width_m: float, rng: np.random.Generator
) -> Float32[ndarray, "*shape"]:
    """Measured distances: U(-half_width, +half_width) added to each finite one.

    0 (no return) and +inf (nothing within range) stay what they are; nothing comes out below 1 mm, because 0
    would mean something else. One number is drawn per entry whatever its value, so later draws do not depend
    on the scene.
    """
    noise = (2.0 * half_width_m) * rng.random(distance_m.shape, dtype=np.float32) - half_width_m
    noisy = np.maximum(distance_m + noise, _NEAREST_M, dtype=np.float32)
    return np.where(distance_m > 0, noisy, np.float32(0.0))
