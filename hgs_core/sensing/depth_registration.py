"""Depth images as seen from the colour camera beside the depth camera."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

_NEAREST_M: Final = 1e-3
_FOOTPRINT_MARGIN: Final = 1.1
"""Pixels of depth are drawn so much wider than they are: neighbours on a slope then leave no cracks through
which what is behind would show."""


class DepthRegistration:
    """Reprojects depth pixel by pixel; where several fall on one colour pixel, the nearest counts.

    Each depth pixel covers as many colour pixels as it is wide in them. Colour pixels that none covers (what
    only the colour camera sees) have no return (0). Depth pixels with nothing in range (+inf) stay directions
    with nothing in range.
    """

    def __init__(self, *, colour: CameraIntrinsics, depth: CameraIntrinsics, T_colour_depth: SE3) -> None:
        self._colour = colour
        rays = depth.rays() @ T_colour_depth.rotation.T
        self._rays: Float32[ndarray, "h w 3"] = rays.astype(np.float32)
        self._offset_m = T_colour_depth.translation.astype(np.float32)
        self._footprint_px = (
            _FOOTPRINT_MARGIN * max(1.0, colour.fx / depth.fx),
            _FOOTPRINT_MARGIN * max(1.0, colour.fy / depth.fy),
        )

    def register(self, depth_m: Float32[ndarray, "height width"]) -> Float32[ndarray, "rows columns"]:
        """z-depth [m] in the colour camera."""
        camera = self._colour
        registered = np.full(camera.height * camera.width, np.inf, np.float32)
        hit = np.zeros(camera.height * camera.width, bool)
        measured = depth_m > 0
        finite = measured & np.isfinite(depth_m)
        self._draw(
            self._rays[finite] * depth_m[finite][:, None] + self._offset_m, registered, hit, at_infinity=False
        )
        self._draw(self._rays[measured & ~finite], registered, hit, at_infinity=True)
        registered[~hit] = 0.0
        return registered.reshape(camera.height, camera.width)

    def _draw(
        self,
        points_m: Float32[ndarray, "n 3"],
        registered: Float32[ndarray, " pixels"],
        hit: ndarray,
        *,
        at_infinity: bool,
    ) -> None:
        camera = self._colour
        points_m = points_m[points_m[:, 2] > _NEAREST_M]
        z = points_m[:, 2]
        u = camera.fx * points_m[:, 0] / z + camera.cx
        v = camera.fy * points_m[:, 1] / z + camera.cy
        width_px, height_px = self._footprint_px
        first_column = np.ceil(u - 0.5 * width_px - 0.5).astype(np.int64)
        first_row = np.ceil(v - 0.5 * height_px - 0.5).astype(np.int64)
        for down in range(int(np.ceil(height_px))):
            row = first_row + down
            rows = (row >= 0) & (row < camera.height) & (row + 0.5 < v + 0.5 * height_px)
            for along in range(int(np.ceil(width_px))):
                column = first_column + along
                inside = rows & (column >= 0) & (column < camera.width) & (column + 0.5 < u + 0.5 * width_px)
                pixels = row[inside] * camera.width + column[inside]
                hit[pixels] = True
                if not at_infinity:
                    np.minimum.at(registered, pixels, z[inside])
