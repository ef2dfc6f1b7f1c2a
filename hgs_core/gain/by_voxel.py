"""What is known of the Gaussians, gathered by the voxels that hold their centres."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import RGB, GaussianMap
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState


def colour_information(gaussians: GaussianMap) -> Float[ndarray, " size"]:
    """H_train of each Gaussian's colour, the mean of its channels: the square of how much of each pixel it
    was, summed over all pixels of all frames. Unlike that of a centre, the same whatever the texture."""
    information: Float[ndarray, " size"] = gaussians.information[: gaussians.size, RGB].mean(axis=1)
    return information


def sums_by_voxel(
    voxels: VoxelMap, gaussians: GaussianMap, values: Float[ndarray, " size"]
) -> tuple[Float64[ndarray, "nx ny nz"], Int[ndarray, "nx ny nz"]]:
    """The sum of a value over the Gaussians of each voxel, and how many they are; those outside the map are
    left out."""
    shape, n_voxels = voxels.states.shape, voxels.states.size
    index, inside = voxels.index_of(gaussians.centres_m.astype(np.float64))
    flat = np.ravel_multi_index(tuple(index[inside].T), shape) if inside.any() else np.zeros(0, np.int64)
    sums = np.bincount(flat, weights=values[inside], minlength=n_voxels).astype(np.float64)
    return sums.reshape(shape), np.bincount(flat, minlength=n_voxels).reshape(shape)


def opaque_voxels(voxels: VoxelMap) -> Bool[ndarray, "nx ny nz"]:
    """Voxels that end a line of sight: occupied, or dismissed (looked at in vain too often)."""
    dismissed = voxels.attempts >= voxels.config.max_attempts
    opaque: Bool[ndarray, "nx ny nz"] = (voxels.states == VoxelState.OCCUPIED) | (
        (voxels.states == VoxelState.UNOBSERVED) & dismissed
    )
    return opaque
