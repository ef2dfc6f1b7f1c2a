"""Coverage gain: how much unobserved space a view would open (HGS-Planner Eq. 4)."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Float32, Float64
from numpy import ndarray

from hgs_core.gain.panorama import Panoramas, by_yaw
from hgs_core.gain.viewpoint import CoverageMeasure
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

_PRIOR_M3: Final = 0.5
"""A layer counts as if, besides what was observed of it, so much were as full as unseen space in the mean."""


def coverage_by_yaw(
    window: Float64[ndarray, "n_elevations n_azimuths"],
    panoramas: Panoramas,
    measure: CoverageMeasure,
    *,
    voxel_volume_m3: float,
    pixels_per_ray: float,
) -> Float64[ndarray, "n n_yaws"]:
    """Coverage of the camera at each yaw; `window` is `PanoramaGrid.window()`.

    `volume`: unobserved volume in view, each part weighted with the transmittance before it [m^3]; the
    integral of `r^2 dr dOmega`, so the same at every resolution. `paper`: Eq. 4 as printed, summed over the
    image's pixels: voxel volume times transmittance, for each unobserved voxel on each pixel's ray; its size
    grows with the camera's resolution.

    `surface`: the surface to be expected [m^2], where unobserved space is as full of it as rooms are: of the
    light that comes into it `exp(-length / free_path_m)` gets through, and what does not has met a surface
    there. Unlike the volume it takes neither an open room for more than what bounds it nor a thin niche for
    less: a unit of it is worth the same early and late. Floors and ceilings are foretold by
    `surface_by_layer`: a thin layer of unseen space under a ceiling hides as much of it as one sees of the
    layer.

    A voxel that was dismissed (looked at in vain) gains nothing.
    """
    if measure is CoverageMeasure.SURFACE:
        return by_yaw(panoramas.new_surface_m2, window)
    if measure is CoverageMeasure.VOLUME:
        return by_yaw(panoramas.unseen_volume_m3, window)
    return by_yaw(panoramas.unseen_voxels, window) * (pixels_per_ray * voxel_volume_m3)


def surface_by_layer(voxels: VoxelMap, *, free_path_m: float) -> Float32[ndarray, " nz"]:
    """How full of surface each layer of voxels is likely to be where it is unobserved: 1 is a surface met in
    `free_path_m`, the mean of unseen space.

    A layer is as full as what has been observed of it: of the voxels of the layers that hold floor or ceiling
    nearly all are occupied, of the others one in six.
    """
    size_m = voxels.config.size_m
    prior = _PRIOR_M3 / size_m**3
    occupied = np.count_nonzero(voxels.states == VoxelState.OCCUPIED, axis=(0, 1))
    observed = np.count_nonzero(voxels.states, axis=(0, 1))
    mean = size_m / free_path_m
    return (((occupied + prior * mean) / (observed + prior)) / mean).astype(np.float32)
