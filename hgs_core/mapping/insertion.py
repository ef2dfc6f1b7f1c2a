"""Where Gaussians are missing, and what the new ones look like."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import N_PARAMETERS
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.mapping.config import InsertionConfig
from hgs_core.mapping.keyframes import TrainingImage

_SORT_CELL_M = 0.25
_MAX_DOUBLINGS = 4
_DETAIL_CELL = 4


def missing_pixels(
    image: TrainingImage, rendered: RenderedView, config: InsertionConfig
) -> Bool[ndarray, "height width"]:
    """Measured pixels that the map leaves open, or shows at something farther away."""
    measured = (image.depth_m > 0) & np.isfinite(image.depth_m)
    open_ = rendered.silhouette < config.silhouette_threshold
    in_front = rendered.depth_m - image.depth_m > config.depth_margin_m
    return measured & (open_ | in_front)


def new_gaussians(
    image: TrainingImage, wanted: Bool[ndarray, "height width"], config: InsertionConfig, *, coarsening: int
) -> Float32[ndarray, "n 8"]:
    """One Gaussian per lattice point that is wanted, sorted by place.

    The lattice has `config.lattice_px` (full-image) pixels between points, `config.detail_lattice_px` where
    the image has detail, times `coarsening` (a power of two); doubled where that would put Gaussians closer
    together than `min_spacing_m` (`detail_spacing_m`).
    """
    camera = image.intrinsics
    detailed = _detailed(image, config.detail_threshold)
    fine = config.detail_lattice_px // 2 * coarsening
    usual = config.lattice_px // 2 * coarsening
    rows, columns = np.nonzero(wanted)
    z = image.depth_m[rows, columns].astype(np.float64)
    has_detail = detailed[rows, columns]
    stride = np.where(has_detail, fine, usual)
    least = np.where(has_detail, config.detail_spacing_m, config.min_spacing_m)
    for _ in range(_MAX_DOUBLINGS):
        stride = np.where(z * stride / camera.fx < least, stride * 2, stride)
    on_lattice = (rows % stride == stride // 2) & (columns % stride == stride // 2)
    rows, columns, z, stride = rows[on_lattice], columns[on_lattice], z[on_lattice], stride[on_lattice]

    parameters = np.empty((len(z), N_PARAMETERS), np.float32)
    x = (columns + 0.5 - camera.cx) / camera.fx * z
    y = (rows + 0.5 - camera.cy) / camera.fy * z
    parameters[:, 0:3] = image.T_world_camera.apply(np.stack([x, y, z], axis=1))
    parameters[:, 3:6] = _mean_colour(image, rows, columns)
    parameters[:, 6] = np.log(config.radius_factor * stride * z / camera.fx)
    parameters[:, 7] = np.log(config.opacity / (1.0 - config.opacity))
    return parameters[_place_order(parameters[:, 0:3])]


def _detailed(image: TrainingImage, threshold: float) -> Bool[ndarray, "height width"]:
    """Pixels in cells of 4 x 4 whose brightness spans more than `threshold` (0..1)."""
    height, width = image.depth_m.shape
    brightness = image.rgb.astype(np.int16).sum(axis=2)
    rows, columns = -(-height // _DETAIL_CELL), -(-width // _DETAIL_CELL)
    padded = np.pad(
        brightness, ((0, rows * _DETAIL_CELL - height), (0, columns * _DETAIL_CELL - width)), mode="edge"
    )
    cells = padded.reshape(rows, _DETAIL_CELL, columns, _DETAIL_CELL)
    span = cells.max(axis=(1, 3)) - cells.min(axis=(1, 3))
    wide = np.repeat(np.repeat(span > threshold * 3 * 255, _DETAIL_CELL, axis=0), _DETAIL_CELL, axis=1)
    detailed: Bool[ndarray, "height width"] = wide[:height, :width]
    return detailed


def _mean_colour(
    image: TrainingImage, rows: Int[ndarray, " n"], columns: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """Colour of the 2 x 2 pixels at each point, 0..1."""
    below = np.minimum(rows + 1, image.rgb.shape[0] - 1)
    right = np.minimum(columns + 1, image.rgb.shape[1] - 1)
    total = image.rgb[rows, columns].astype(np.float64)
    for r, c in ((below, columns), (rows, right), (below, right)):
        total += image.rgb[r, c]
    return total / (4 * 255.0)


def _place_order(points_m: Float32[ndarray, "n 3"]) -> Int[ndarray, " n"]:
    """Order along a Morton curve of 25 cm cells, so that blocks of the map stay compact."""
    if len(points_m) == 0:
        return np.zeros(0, np.int64)
    cells = np.floor((points_m - points_m.min(axis=0)) / _SORT_CELL_M).astype(np.int64)
    code = np.zeros(len(cells), np.int64)
    for bit in range(12):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")
