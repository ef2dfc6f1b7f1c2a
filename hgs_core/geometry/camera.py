"""Pinhole cameras: OpenCV axes (x right, y down, z forward), pixel centres at integer + 0.5."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.errors import ConfigError
from hgs_core.geometry.se3 import SE3


@dataclass(frozen=True, kw_only=True)
class CameraIntrinsics:
    """A pinhole camera without distortion; `fx, fy, cx, cy` in pixels.

    A point `(x, y, z)` in the camera projects to `(fx x/z + cx, fy y/z + cy)`; pixel `(row, column)` covers
    `[column, column + 1) x [row, row + 1)` and its ray goes through its centre.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    low_pass_px2: float = 1.0 / 12.0
    """Variance [px^2] by which a drawn splat is wider than its Gaussian, since a pixel is not a point: that
    of a square pixel. (3DGS takes 0.3, which blurs what is as fine as a pixel.)"""

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not (self.fx > 0 and self.fy > 0):
            raise ConfigError(f"camera needs a positive size and focal length, got {self}")
        if not self.low_pass_px2 > 0:
            raise ConfigError(f"camera needs a positive low_pass_px2, got {self.low_pass_px2}")

    @staticmethod
    def centred(width: int, height: int, focal_px: float) -> CameraIntrinsics:
        return CameraIntrinsics(
            width=width, height=height, fx=focal_px, fy=focal_px, cx=width / 2, cy=height / 2
        )

    @property
    def horizontal_fov_rad(self) -> float:
        return float(np.arctan(self.cx / self.fx) + np.arctan((self.width - self.cx) / self.fx))

    @property
    def vertical_fov_rad(self) -> float:
        return float(np.arctan(self.cy / self.fy) + np.arctan((self.height - self.cy) / self.fy))

    def scaled(self, factor: float) -> CameraIntrinsics:
        """The same camera with `factor` times as many pixels a side."""
        return replace(
            self,
            width=round(self.width * factor),
            height=round(self.height * factor),
            fx=self.fx * factor,
            fy=self.fy * factor,
            cx=self.cx * factor,
            cy=self.cy * factor,
        )

    def rays(self) -> Float[ndarray, "height width 3"]:
        """Ray directions of the pixel centres in the camera frame, scaled to z = 1."""
        u = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        v = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        rays = np.empty((self.height, self.width, 3))
        rays[..., 0] = u[None, :]
        rays[..., 1] = v[:, None]
        rays[..., 2] = 1.0
        return rays

    def project(
        self, points_camera: Float[ndarray, "n 3"]
    ) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"]]:
        """Pixel coordinates of points [m], and which of them lie in front of and inside the image."""
        z = points_camera[:, 2]
        front = z > 1e-6
        safe = np.where(front, z, 1.0)
        u = self.fx * points_camera[:, 0] / safe + self.cx
        v = self.fy * points_camera[:, 1] / safe + self.cy
        inside = front & (u >= 0) & (u < self.width) & (v >= 0) & (v < self.height)
        return np.stack([u, v], axis=1), inside


def level_camera_pose(x_m: float, y_m: float, z_m: float, yaw_rad: float) -> SE3:
    """`T_world_camera` of a camera that looks level along `yaw_rad` (0 = world +x, counter-clockwise)."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    rotation = np.array([[sin, 0.0, cos], [-cos, 0.0, sin], [0.0, -1.0, 0.0]])
    return SE3(rotation=rotation, translation=np.array([x_m, y_m, z_m], dtype=float))
