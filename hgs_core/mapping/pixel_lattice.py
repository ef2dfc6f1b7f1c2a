"""The points of a surface that new Gaussians start from: a lattice in the image, even on the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.surface import surface_slopes, surface_steps

_LONGEST: Final = 8.0
"""Points of neighbouring pixels count as at most so many times as far apart as if the surface faced the
camera."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LatticePoints:
    """Points on the surface that a depth image shows."""

    rows: Int[ndarray, " n"]
    columns: Int[ndarray, " n"]
    """The pixel that each lies in."""
    points_m: Float[ndarray, "n 3"]
    """In the camera's frame."""
    apart_m: Float[ndarray, " n"]
    """The edge of the square of surface that each stands for."""


def lattice_points(
    depth_m: Float32[ndarray, "height width"],
    camera: CameraIntrinsics,
    wanted: Bool[ndarray, "height width"],
    spacing_m: Float32[ndarray, "height width"],
    *,
    follow_slant: bool,
    gap_m: float,
    grazing_pitch: float,
) -> LatticePoints:
    """Points about `spacing_m` apart on the surface seen in the wanted pixels, which must be measured.

    The pitch, in columns and in rows, is the power of two of pixels that comes nearest to that spacing on the
    surface (slanted as it is, with `follow_slant`): powers of two, so that lattices of different pitch share
    their points. Pixels that are farther apart than that and than `gap_m`, on a surface that is seen at a
    grazing angle and goes on beside them, give several points each, down to `grazing_pitch`.
    """
    rows, columns = np.nonzero(wanted)
    depth = depth_m[rows, columns].astype(np.float64)
    facing = (depth / camera.fx, depth / camera.fy)
    steps = surface_steps(depth_m, camera, rows, columns) if follow_slant else facing
    pitches, slopes = [], []
    for axis in range(2):
        spacing = spacing_m[rows, columns]
        beyond = np.maximum(spacing / steps[axis], 1.0)
        within = np.clip(np.maximum(spacing, gap_m) / steps[axis], grazing_pitch, 1.0)
        pitch = np.exp2(np.round(np.log2(beyond * within)))
        divided, slope = np.flatnonzero(pitch < 1.0), np.zeros(len(rows))
        slope[divided], goes_on = surface_slopes(depth_m, rows[divided], columns[divided], axis)
        pitch[divided[~goes_on]] = 1.0
        pitches.append(pitch)
        slopes.append(slope)
    edges = [
        np.minimum(step * np.minimum(pitch, 1.0), _LONGEST * least) * np.maximum(pitch, 1.0)
        for step, pitch, least in zip(steps, pitches, facing, strict=True)
    ]
    chosen = (columns % np.maximum(pitches[0], 1.0) == 0) & (rows % np.maximum(pitches[1], 1.0) == 0)
    of, across, down = _within_pixels(np.flatnonzero(chosen), *pitches)
    z = 1.0 / (1.0 / depth[of] + across * slopes[0][of] + down * slopes[1][of])
    rows, columns = rows[of], columns[of]
    x = (columns + 0.5 + across - camera.cx) / camera.fx * z
    y = (rows + 0.5 + down - camera.cy) / camera.fy * z
    return LatticePoints(
        rows=rows,
        columns=columns,
        points_m=np.stack([x, y, z], axis=1),
        apart_m=np.sqrt(edges[0][of] * edges[1][of]),
    )


def _within_pixels(
    chosen: Int[ndarray, " n"], column_pitch: Float[ndarray, " _"], row_pitch: Float[ndarray, " _"]
) -> tuple[Int[ndarray, " m"], Float[ndarray, " m"], Float[ndarray, " m"]]:
    """The points of the chosen pixels: which pixel, and how far from its middle by column and by row [px].

    One in the middle where both pitches are at least 1, else evenly spread over the pixel.
    """
    n_across = np.maximum(1.0 / column_pitch[chosen], 1.0).astype(np.int64)
    n_down = np.maximum(1.0 / row_pitch[chosen], 1.0).astype(np.int64)
    n = n_across * n_down
    pixel = np.repeat(np.arange(len(chosen)), n)
    rank = np.arange(len(pixel)) - np.repeat(np.cumsum(n) - n, n)
    across = (rank % n_across[pixel] + 0.5) / n_across[pixel] - 0.5
    down = (rank // n_across[pixel] + 0.5) / n_down[pixel] - 0.5
    return chosen[pixel], across, down
