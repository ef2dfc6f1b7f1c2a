"""The slant and the borders of the surfaces that a depth image shows."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics

_BEND_M: Final = 0.05
"""Beyond the noise of smoothed depth."""

_LONGEST: Final = 8.0
"""Steps end at so many times those of a surface that faces the camera."""


def surface_steps(
    depth_m: Float32[ndarray, "height width"],
    camera: CameraIntrinsics,
    rows: Int[ndarray, " n"],
    columns: Int[ndarray, " n"],
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """How far it is on the surface from each of the pixels to the next column, and to the next row [m].

    `depth_m` must be smooth, and measured at the pixels. Slopes are the smaller of both one-sided
    differences of inverse depth (linear in the image on any plane), so at the border of a surface they are
    that surface's.
    """
    z = depth_m[rows, columns].astype(np.float64)
    ray_x, ray_y = (columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy
    ray_squared = ray_x**2 + ray_y**2 + 1.0
    steps = []
    for axis, (focal, ray_along) in enumerate(((camera.fx, ray_x), (camera.fy, ray_y))):
        forward = _inverse_depth(depth_m, rows + axis, columns + 1 - axis) - 1.0 / z
        backward = 1.0 / z - _inverse_depth(depth_m, rows - axis, columns - 1 + axis)
        take_forward = np.isnan(backward) | (np.abs(forward) <= np.abs(backward))
        slope = -(z**2) * np.nan_to_num(np.where(take_forward, forward, backward))  # of z [m/px]
        facing = z / focal
        # |slope ray + facing e|^2 with the unit vector e along the axis.
        squared = slope**2 * ray_squared + 2.0 * slope * facing * ray_along + facing**2
        steps.append(np.minimum(np.sqrt(squared), _LONGEST * facing))
    return steps[0], steps[1]


def surface_borders(depth_m: Float32[ndarray, "height width"]) -> Bool[ndarray, "height width"]:
    """Pixels where a surface ends or bends by more than `_BEND_M`, and their neighbours.

    Inverse depth is linear in the image on a plane, so its second difference, in metres at that distance, is
    how far the surface departs from one. What was not measured counts as infinitely far.
    """
    measured = (depth_m > 0) & np.isfinite(depth_m)
    depth = np.where(measured, depth_m, np.float32(1.0))
    inverse = np.where(measured, np.float32(1.0) / depth, np.float32(0.0))
    bent = np.zeros(depth_m.shape, bool)
    bent[:, 1:-1] |= np.abs(np.diff(inverse, 2, axis=1)) * depth[:, 1:-1] ** 2 > _BEND_M
    bent[1:-1, :] |= np.abs(np.diff(inverse, 2, axis=0)) * depth[1:-1, :] ** 2 > _BEND_M
    borders = bent.copy()
    borders[:, 1:] |= bent[:, :-1]
    borders[:, :-1] |= bent[:, 1:]
    borders[1:, :] |= bent[:-1, :]
    borders[:-1, :] |= bent[1:, :]
    return borders & measured


def _inverse_depth(
    depth_m: Float32[ndarray, "height width"], rows: Int[ndarray, " n"], columns: Int[ndarray, " n"]
) -> Float[ndarray, " n"]:
    """1 / depth at pixels [1/m]; NaN beyond the image and where nothing was measured."""
    height, width = depth_m.shape
    depth = depth_m[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(np.float64)
    known = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    known &= (depth > 0) & np.isfinite(depth)
    inverse: Float[ndarray, " n"] = np.where(known, 1.0 / np.where(known, depth, 1.0), np.nan)
    return inverse
