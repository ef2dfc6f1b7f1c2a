"""The map from above, without its ceiling, and the way that the robot took."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from PIL import Image, ImageDraw

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

_CAMERA_HEIGHT_M: Final = 40.0
"""High enough that walls are seen from above, not from the side."""

_BORDER_SHARE: Final = 0.002
"""Share of the Gaussians that may lie outside the picture on each side."""

_LOOKING_DOWN: Final = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""Image right = world x, image up = world y."""

_PATH_RGB: Final = (255, 60, 0)
_START_RGB: Final = (255, 255, 255)
_END_RGB: Final = (0, 0, 0)


def top_view(
    gaussians: GaussianMap,
    positions_m: Float[ndarray, "n 3"],
    *,
    width_px: int = 1200,
    cut_height_m: float = 2.0,
    bounds_m: tuple[Float[ndarray, " 2"], Float[ndarray, " 2"]] | None = None,
) -> UInt8[ndarray, "height width 3"]:
    """Draw the Gaussians below `cut_height_m` from above, and `positions_m` as a line; world y points up.

    Shows what lies between the two corners `bounds_m` in x and y; None = the map itself. The robot's start is
    a white dot, its end a black one. Rendered by the map's own kernels. Raises `MapError` when nothing lies
    below the cut.
    """
    below = gaussians.centres_m[:, 2] < cut_height_m
    if not below.any():
        raise MapError(f"no Gaussian lies below {cut_height_m} m: cut higher")
    shown = GaussianMap(primitive=gaussians.primitive)
    rows = slice(gaussians.size)
    shown.append(gaussians.parameters[rows][below], gaussians.normals[rows][below], anchor_keyframe=0)
    lower, upper = bounds_m if bounds_m is not None else _extent(gaussians)
    size = np.maximum(upper - lower, 0.1) * 1.02
    pixels_per_metre = width_px / size[0]
    camera = CameraIntrinsics.centred(
        width_px, max(1, round(size[1] * pixels_per_metre)), pixels_per_metre * _CAMERA_HEIGHT_M
    )
    pose = SE3(rotation=_LOOKING_DOWN, translation=np.array([*(lower + upper) / 2, _CAMERA_HEIGHT_M]))
    colour = np.clip(render(shown, camera, pose).colour, 0.0, 1.0)
    picture = Image.fromarray((colour * 255.0 + 0.5).astype(np.uint8))
    on_floor = np.array(positions_m, dtype=np.float64) * [1.0, 1.0, 0.0]
    line, _ = camera.project(pose.inverse().apply(on_floor))
    _draw_way(ImageDraw.Draw(picture), line, width_px=max(2, width_px // 250))
    return np.asarray(picture)


def _extent(gaussians: GaussianMap) -> tuple[Float[ndarray, " 2"], Float[ndarray, " 2"]]:
    border = [_BORDER_SHARE, 1.0 - _BORDER_SHARE]
    lower, upper = np.quantile(gaussians.centres_m[:, :2].astype(np.float64), border, axis=0)
    return lower, upper


def _draw_way(draw: ImageDraw.ImageDraw, pixels: Float[ndarray, "n 2"], *, width_px: int) -> None:
    way = [(float(u), float(v)) for u, v in pixels]
    draw.line(way, fill=_START_RGB, width=width_px + 2, joint="curve")  # a rim, seen on floors of any colour
    draw.line(way, fill=_PATH_RGB, width=width_px, joint="curve")
    radius = 2.0 * width_px
    for (u, v), fill in zip((way[0], way[-1]) if way else (), (_START_RGB, _END_RGB), strict=False):
        draw.ellipse((u - radius, v - radius, u + radius, v + radius), fill, _PATH_RGB, width_px)
