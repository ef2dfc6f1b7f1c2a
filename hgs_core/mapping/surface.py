"""The slant, the normals and the borders of the surfaces that a depth image shows."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.native import kernels

_BEND_M: Final = 0.05
"""Beyond the noise of smoothed depth."""

_LONGEST: Final = 32.0
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
    ray = _rays(camera, rows, columns)
    ray_squared = np.sum(ray**2, axis=1)
    steps = []
    for axis, (focal, of_inverse) in enumerate(
        zip((camera.fx, camera.fy), _slopes(depth_m, rows, columns), strict=True)
    ):
        slope = -(z**2) * of_inverse  # of z [m/px]
        facing = z / focal
        # |slope ray + facing e|^2 with the unit vector e along the axis.
        squared = slope**2 * ray_squared + 2.0 * slope * facing * ray[:, axis] + facing**2
        steps.append(np.minimum(np.sqrt(squared), _LONGEST * facing))
    return steps[0], steps[1]


def surface_normals(
    depth_m: Float32[ndarray, "height width"],
    camera: CameraIntrinsics,
    rows: Int[ndarray, " n"],
    columns: Int[ndarray, " n"],
) -> Float[ndarray, "n 3"]:
    """Unit normals at these pixels in the camera's frame, towards it; without one, the way to the camera.

    `depth_m` must be smooth, and measured at the pixels. On a plane inverse depth is linear in the image; it
    is fitted to those of the 7 x 7 pixels around that agree with it to 3 cm, at first with the slopes of
    `surface_steps`, so that at the border of a surface they are that surface's own. With fewer than 12 of
    them on one plane there is no normal.
    """
    normals = np.empty((len(rows), 3))
    kernels.surface_normals(
        depth_m,
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        np.ascontiguousarray(rows, np.int64),
        np.ascontiguousarray(columns, np.int64),
        normals,
    )
    return normals


def surface_slopes(
    depth_m: Float32[ndarray, "height width"],
    rows: Int[ndarray, " n"],
    columns: Int[ndarray, " n"],
    axis: int,
) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
    """Of inverse depth by column (axis 0) or by row (1) [1/m/px], and whether it is that of a surface.

    It is on the sides where inverse depth goes on straight, to `_BEND_M`, for two pixels; the mean of both
    sides'. 0 where there is no such side, as on a leg of one pixel.
    """
    here = 1.0 / depth_m[rows, columns].astype(np.float64)
    total, sides = np.zeros(len(rows)), np.zeros(len(rows))
    for side in (-1, 1):
        beside, beyond = (
            _inverse_depth(depth_m, rows + far * side * axis, columns + far * side * (1 - axis))
            for far in (1, 2)
        )
        straight = np.abs(here - 2.0 * beside + beyond) < _BEND_M * here**2
        total += np.where(straight, side * (beside - here), 0.0)
        sides += straight
    return total / np.maximum(sides, 1.0), sides > 0


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


def _rays(
    camera: CameraIntrinsics, rows: Int[ndarray, " n"], columns: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """Through the centres of pixels, with z = 1, in the camera's frame."""
    x, y = (columns + 0.5 - camera.cx) / camera.fx, (rows + 0.5 - camera.cy) / camera.fy
    return np.stack([x, y, np.ones_like(x)], axis=1)


def _slopes(
    depth_m: Float32[ndarray, "height width"], rows: Int[ndarray, " n"], columns: Int[ndarray, " n"]
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Of inverse depth by column and by row [1/m/px]: the smaller one-sided difference; 0 without."""
    here = 1.0 / depth_m[rows, columns].astype(np.float64)
    slopes = []
    for axis in range(2):
        forward = _inverse_depth(depth_m, rows + axis, columns + 1 - axis) - here
        backward = here - _inverse_depth(depth_m, rows - axis, columns - 1 + axis)
        take_forward = np.isnan(backward) | (np.abs(forward) <= np.abs(backward))
        slopes.append(np.nan_to_num(np.where(take_forward, forward, backward)))
    return slopes[0], slopes[1]


def _inverse_depth(
    depth_m: Float32[ndarray, "height width"], rows: Int[ndarray, "*n"], columns: Int[ndarray, "*n"]
) -> Float[ndarray, "*n"]:
    """1 / depth at pixels [1/m]; NaN beyond the image and where nothing was measured."""
    height, width = depth_m.shape
    depth = depth_m[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(np.float64)
    known = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    known &= (depth > 0) & np.isfinite(depth)
    inverse: Float[ndarray, "*n"] = np.where(known, 1.0 / np.where(known, depth, 1.0), np.nan)
    return inverse
