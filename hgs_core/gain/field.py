"""What each voxel near the viewpoints means to a ray: how opaque it is, and what seeing it is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float32, Int
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.gaussians.gaussian_map import BLOCK, N_PARAMETERS
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

SEEN_ONCE_FROM_M: Final = 2.5
"""A Gaussian that no keyframe has seen counts as seen once from here [m]: some frame did see it."""

HARDLY_SEEN_FROM_M: Final = 8.0
"""However little is known of a Gaussian, it counts as seen once from here [m]: nothing that stays hidden for
ever may outweigh a whole room."""

MIN_OPACITY: Final = 0.005
"""Fainter Gaussians are on their way out of the map and count for nothing."""

OPTICAL_DEPTH, UNSEEN, QUALITY = 0, 1, 2
"""Channels of `GainField.cells`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GainField:
    """The voxels in a box around the viewpoints.

    `cells[..., 0]` is a voxel's optical depth over one edge length, `cells[..., 1]` is 1 where seeing it is
    coverage, `cells[..., 2]` is `Q_v`: the expected sum of information ratios of its Gaussians in a view
    from 1 m away [m^2], to be divided by the squared distance.
    """

    first_index: Int[ndarray, " 3"]
    """Global voxel index of `cells[0, 0, 0]`."""
    cells: Float32[ndarray, "nx ny nz 3"]
    gaussians_per_m2: float
    """Mean number of Gaussians on a voxel face's area of surface; 0 where there are none."""

    def holds(self, first: Int[ndarray, " 3"], last: Int[ndarray, " 3"]) -> bool:
        """Whether the voxels with global indices `first <= index < last` lie inside."""
        end = self.first_index + self.cells.shape[:3]
        return bool(np.all(self.first_index <= first) and np.all(last <= end))


def gain_field(
    snapshot: MapSnapshot,
    first: Int[ndarray, " 3"],
    last: Int[ndarray, " 3"],
    *,
    prior_information: float,
    focal_px: float,
) -> GainField:
    """Gather the maps over the voxels with global indices `first <= index < last`, which lie in the map.

    Opacity: a Gaussian of opacity `o` and radius `r` adds `2 pi o r^2 / face area` to the optical depth of
    the voxel that holds its centre. Occupied voxels let nothing through whatever their Gaussians, and
    neither do dismissed ones (looked at in vain too often); other unobserved voxels are transparent, as in
    Eq. 4.

    Quality (Eq. 9 in its trace form): with `I_ik` the training information of parameter `k` of Gaussian
    `i`, one more view from distance `d` gains `q_i / d^2`, `q_i = c_i / I_i,colour * sum_k I_ik / (I_ik +
    prior)`, where `c_i` is the colour information expected from 1 m: that of its bare splat, `pi o^2
    (focal_px r)^2`, times the share that neighbours on the surface leave uncovered, as measured on the
    training views. So what was seen from afar, at a grazing angle or half hidden promises more than what
    was seen well.
    """
    voxels, gaussians = snapshot.voxels, snapshot.gaussians
    shape = tuple(int(n) for n in last - first)
    optical_depth = np.zeros(shape, np.float32)
    quality = np.zeros(shape, np.float32)
    count = np.zeros(shape, np.int32)
    kernels.gather_gaussians(
        gaussians.parameters[: gaussians.size],
        gaussians.information[: gaussians.size],
        gaussians.information_weight[: gaussians.size],
        gaussians.block_bounds,
        BLOCK,
        first * voxels.config.size_m,
        voxels.config.size_m,
        prior_information,
        focal_px,
        N_PARAMETERS * SEEN_ONCE_FROM_M**2,
        N_PARAMETERS * HARDLY_SEEN_FROM_M**2,
        MIN_OPACITY,
        optical_depth,
        quality,
        count,
    )
    cells = np.empty((*shape, 3), np.float32)
    _opacity(voxels, first, optical_depth, cells)
    cells[..., QUALITY] = quality
    populated = count > 0
    n_populated = int(np.count_nonzero(populated))
    per_face = float(count.sum()) / n_populated if n_populated else 0.0
    return GainField(first_index=first, cells=cells, gaussians_per_m2=per_face / voxels.config.size_m**2)


def _opacity(
    voxels: VoxelMap,
    first: Int[ndarray, " 3"],
    optical_depth: Float32[ndarray, "nx ny nz"],
    cells: Float32[ndarray, "nx ny nz 3"],
) -> None:
    low = first - voxels.origin_index
    box = tuple(slice(int(a), int(a) + n) for a, n in zip(low, optical_depth.shape, strict=True))
    states = voxels.states[box]
    unobserved = states == VoxelState.UNOBSERVED
    dismissed = unobserved & (voxels.attempts[box] >= voxels.config.max_attempts)
    cells[..., OPTICAL_DEPTH] = np.where(dismissed | (states == VoxelState.OCCUPIED), np.inf, optical_depth)
    cells[..., UNSEEN] = unobserved & ~dismissed
