"""Which of many given points a viewpoint sees, weighed and gathered by yaw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int, Int32
from numpy import ndarray

from hgs_core.gain.panorama import PanoramaGrid, by_yaw
from hgs_core.voxels.voxel_map import VoxelMap

_SIGHT_STEP: Final = 0.7
"""Spacing of the samples along a line of sight, in voxels."""
_LINES_AT_ONCE: Final = 50_000
"""Pairs of a view and a target looked at together: bounds the memory that a cycle takes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Targets:
    """Points worth seeing."""

    points_m: Float[ndarray, "n 3"]
    weights: Float[ndarray, " n"]
    """What seeing each is worth."""
    normals: Float[ndarray, "n 3"] | None = None
    """Unit vectors out of the surface on which each lies; None: seen from any side."""


@dataclass(frozen=True, kw_only=True)
class SightLimits:
    """From where a target counts as seen."""

    near_m: float
    far_m: float
    """Least and greatest distance."""
    max_incidence_rad: float = np.pi / 2
    """Greatest angle between a target's normal and the line of sight."""
    level: bool = False
    """Whether distances are those in the plane."""


def seen_by_yaw(
    grid: PanoramaGrid,
    targets: Targets,
    voxels: VoxelMap,
    opaque: Bool[ndarray, "nx ny nz"],
    positions_m: Float[ndarray, "n_views 3"],
    limits: SightLimits,
) -> Float64[ndarray, "n_views n_yaws"]:
    """The weights of the targets that a level camera sees from each position, summed, for each of its yaws.

    A target is seen within the limits, in the field of view (by the panorama's bins) and when no `opaque`
    voxel lies on the line to it; the voxel that holds it may be opaque. Outside the map nothing is.
    """
    panoramas = np.zeros((len(positions_m), grid.n_elevations, grid.n_azimuths), np.float32)
    at_once = max(1, _LINES_AT_ONCE // max(len(targets.points_m), 1))
    for first in range(0, len(positions_m), at_once):
        part = panoramas[first : first + at_once]
        from_m = positions_m[first : first + at_once]
        views, marks = _pairs_within(from_m, targets, limits)
        bins, visible = _panorama_bins(grid, targets.points_m[marks] - from_m[views])
        views, marks, bins = views[visible], marks[visible], bins[visible]
        clear = is_clear(voxels, opaque, from_m[views], targets.points_m[marks], far_m=limits.far_m)
        flat = views[clear] * part[0].size + bins[clear]
        seen = np.bincount(flat, weights=targets.weights[marks[clear]], minlength=part.size)
        part[:] = seen.reshape(part.shape)
    return by_yaw(panoramas, grid.window())


def is_clear(
    voxels: VoxelMap,
    opaque: Bool[ndarray, "nx ny nz"],
    from_m: Float[ndarray, "n 3"],
    to_m: Float[ndarray, "n 3"],
    *,
    far_m: float,
) -> Bool[ndarray, " n"]:
    """Which lines of sight, at most `far_m` long, meet no opaque voxel before the one that they end in; none
    of those that begin or end outside the map."""
    n_samples = max(int(np.ceil(far_m / (_SIGHT_STEP * voxels.config.size_m))), 2)
    starts, ends = (_in_voxels(voxels, points_m) for points_m in (from_m, to_m))
    upper = np.array(opaque.shape)
    # The map is convex: between two points inside, every sample is.
    clear: Bool[ndarray, " n"] = np.all(
        (np.minimum(starts, ends) >= 0) & (np.maximum(starts, ends) < upper), 1
    )
    at_end, solid = _flat_cells(ends.T, opaque.shape), opaque.ravel()
    for part in np.array_split(np.arange(1, n_samples, dtype=np.float32) / n_samples, 4):
        # Most lines that are blocked are so early: each part tests those that are left.
        left = np.flatnonzero(clear)
        first, along = starts[left].T[..., None], (ends - starts)[left].T[..., None]
        cells = _flat_cells(first + part * along, opaque.shape)
        clear[left] = ~np.any(solid[cells] & (cells != at_end[left, None]), axis=1)
    return clear


def _in_voxels(voxels: VoxelMap, points_m: Float[ndarray, "n 3"]) -> Float32[ndarray, "n 3"]:
    """Points in units of voxels from the map's lower corner."""
    points: Float32[ndarray, "n 3"] = (points_m / voxels.config.size_m - voxels.origin_index).astype(
        np.float32
    )
    return points


def _flat_cells(xyz: Float32[ndarray, "3 *n"], shape: tuple[int, ...]) -> Int32[ndarray, "*n"]:
    """Flat array indices of the voxels that hold points inside the map."""
    x, y, z = xyz.astype(np.int32)
    cells: Int32[ndarray, "*n"] = (x * shape[1] + y) * shape[2] + z
    return cells


def _pairs_within(
    from_m: Float[ndarray, "n_views 3"], targets: Targets, limits: SightLimits
) -> tuple[Int[ndarray, " n"], Int[ndarray, " n"]]:
    """Views and targets, as indices, that are near enough and face each other."""
    lines = targets.points_m[None] - from_m[:, None]
    away = np.linalg.norm(lines[..., :2] if limits.level else lines, axis=2)
    facing = (away >= limits.near_m) & (away <= limits.far_m)
    if targets.normals is not None:
        straight = np.linalg.norm(lines, axis=2)
        least = np.cos(limits.max_incidence_rad)
        facing &= np.einsum("vtk,tk->vt", lines, targets.normals) <= -least * straight
    views, marks = np.nonzero(facing)
    return views, marks


def _panorama_bins(
    grid: PanoramaGrid, lines: Float[ndarray, "n 3"]
) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
    """The panorama's flat bin of each direction, and which lie within its rows."""
    flat = np.maximum(np.hypot(lines[:, 0], lines[:, 1]), 1e-9)
    row = (lines[:, 2] / flat - grid.tan_low) / (grid.tan_high - grid.tan_low) * grid.n_elevations
    azimuth = (np.arctan2(lines[:, 1], lines[:, 0]) + np.pi) / grid.azimuth_step_rad
    visible: Bool[ndarray, " n"] = (row >= 0) & (row < grid.n_elevations)
    column = np.floor(azimuth).astype(np.int64) % grid.n_azimuths
    return np.where(visible, np.floor(row), 0).astype(np.int64) * grid.n_azimuths + column, visible
