"""Both gains of one view as they are defined, at the camera's full resolution: slow, to judge others by."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from hgs_core.gaussians.information import quality_image
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

PIXEL_STRIDE: Final = 4
"""Every so many rows and columns of the full image count in the coverage: its slices are far coarser."""


def exact_quality(
    snapshot: MapSnapshot,
    camera: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    prior_information: float,
    range_m: float,
) -> float:
    """Eq. 9's gain of a view: `sum_ik H_cand,ik / (H_train,ik + prior_k)` over every pixel of its image."""
    image = quality_image(snapshot.gaussians, camera, T_world_camera, prior_information, far_m=range_m)
    return float(image.sum(dtype=np.float64))


def exact_coverage(
    snapshot: MapSnapshot, camera: CameraIntrinsics, T_world_camera: SE3, *, range_m: float
) -> float:
    """Unobserved volume in a view, weighted with the transmittance of the splats before it [m^3] (Eq. 4).

    The view is cut into slices of depth, half a voxel thick, and drawn up to each of them: what is left of
    the light there is `prod(1 - alpha_j)` of the Gaussians before it, as they are drawn. Beside them, voxels
    that are occupied or dismissed let nothing through, and a pixel sees `range_m` far as measured
    horizontally, both as in `march`.
    """
    voxels = snapshot.voxels
    step_m = 0.5 * voxels.config.size_m
    gains, opaque = _gaining_and_opaque(voxels)
    rays = camera.rays()[::PIXEL_STRIDE, ::PIXEL_STRIDE].reshape(-1, 3)
    horizontal = np.hypot(rays[:, 0], rays[:, 2])
    is_open = np.ones(len(rays), dtype=bool)
    volume = 0.0
    for near_m in np.arange(0.0, range_m, step_m):
        middle_m = near_m + 0.5 * step_m
        index, inside = voxels.index_of(T_world_camera.apply(rays * middle_m))
        cells = tuple(index[inside].T)
        is_open[inside] &= ~opaque[cells]
        unseen = np.zeros(len(rays), dtype=bool)
        unseen[inside] = gains[cells]
        unseen &= is_open & (horizontal * middle_m < range_m)
        if not unseen.any():
            continue
        drawn = render(snapshot.gaussians, camera, T_world_camera, far_m=middle_m)
        left = 1.0 - drawn.silhouette[::PIXEL_STRIDE, ::PIXEL_STRIDE].reshape(-1)
        area = (PIXEL_STRIDE * middle_m) ** 2 / (camera.fx * camera.fy)
        volume += float(left[unseen].sum(dtype=np.float64)) * area * step_m
    return volume


def _gaining_and_opaque(
    voxels: VoxelMap,
) -> tuple[Bool[ndarray, "nx ny nz"], Bool[ndarray, "nx ny nz"]]:
    """Where seeing a voxel is a gain, and where one lets nothing through."""
    unobserved = voxels.states == VoxelState.UNOBSERVED
    dismissed = unobserved & (voxels.attempts >= voxels.config.max_attempts)
    return unobserved & ~dismissed, dismissed | (voxels.states == VoxelState.OCCUPIED)
