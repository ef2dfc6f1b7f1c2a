"""What stays unseen, and why: every "nothing left" has to answer for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import find_objects, label

from hgs_core.geometry.boxes import Box
from hgs_core.planning.plan import SubspaceState, UnseenReason, UnseenRegion
from hgs_core.planning.subspaces import SubspacePartition
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

OCCLUDED_M3 = 0.05
"""Dismissed voxels in smaller clusters are specks behind edges, not regions."""
OPENING_M2 = 1.0
"""Free voxels on the region's border in smaller clusters are not openings."""


Lost = tuple[UnseenReason, Float[ndarray, "_ 2"]]
"""Places where the robot could stand if the operator did not ask for something, and the reason to give."""


def unseen_regions(
    voxels: VoxelMap,
    partition: SubspacePartition,
    places_m: Float[ndarray, "n 2"],
    *,
    camera_range_m: float,
    region: Box | None,
    whole: VoxelMap | None = None,
    lost: Sequence[Lost] = (),
) -> tuple[UnseenRegion, ...]:
    """Clusters of missing, dismissed and out-of-bounds voxels, largest first.

    Where only a region of interest is worth seeing in `voxels`, `whole` is the map as it is: what is missing
    in that alone lies `OUTSIDE_REGION`. A missing cluster gets its subspace's reason; one whose
    subspace is still open would have been visited next: `INTERRUPTED` (the mission knows what ended it).
    `places_m` are the places where the robot can stand; where a `lost` place is nearer to the cluster than
    all of them, its reason is given.
    """
    regions = [
        _region(voxels, box, count, _why_missing(voxels, box, partition, places_m, lost, camera_range_m))
        for box, count in _clusters(voxels.missing(), minimum=1)
    ]
    dismissed = _dismissed(voxels if whole is None else whole)
    size_m = voxels.config.size_m
    if voxels.interest is not None and whole is not None:
        outside = ~voxels.interest[..., None]
        regions += [
            _region(voxels, box, count, UnseenReason.OUTSIDE_REGION)
            for box, count in _clusters(whole.missing() & outside, minimum=1)
        ]
        dismissed &= ~outside
    regions += [
        _region(voxels, box, count, UnseenReason.OCCLUDED)
        for box, count in _clusters(dismissed, minimum=round(OCCLUDED_M3 / size_m**3))
    ]
    if region is not None:
        regions += [
            _region(voxels, box, count, UnseenReason.OUT_OF_BOUNDS)
            for box, count in _clusters(_openings(voxels), minimum=round(OPENING_M2 / size_m**2))
        ]
    return tuple(sorted(regions, key=lambda r: (-r.volume_m3, r.lower_m)))


Cluster = tuple[slice, slice, slice]


def _clusters(mask: Bool[ndarray, "nx ny nz"], *, minimum: int) -> list[tuple[Cluster, int]]:
    """Bounding slices and sizes of the 26-connected clusters of at least `minimum` voxels."""
    labels, n = label(mask, structure=np.ones((3, 3, 3), int))
    if n == 0:
        return []
    counts = np.bincount(labels.ravel(), minlength=n + 1)[1:]
    boxes = find_objects(labels)
    return [
        ((box[0], box[1], box[2]), int(count))
        for box, count in zip(boxes, counts, strict=True)
        if count >= minimum
    ]


def _region(voxels: VoxelMap, box: Cluster, count: int, reason: UnseenReason) -> UnseenRegion:
    lower, upper = _corners(voxels, box)
    return UnseenRegion(
        lower_m=(float(lower[0]), float(lower[1]), float(lower[2])),
        upper_m=(float(upper[0]), float(upper[1]), float(upper[2])),
        volume_m3=count * voxels.config.size_m**3,
        reason=reason,
    )


def _corners(voxels: VoxelMap, box: Cluster) -> tuple[Float[ndarray, " 3"], Float[ndarray, " 3"]]:
    size = voxels.config.size_m
    lower = np.asarray(voxels.lower_m(), dtype=np.float64)
    return (
        lower + np.array([axis.start for axis in box]) * size,
        lower + np.array([axis.stop for axis in box]) * size,
    )


def _why_missing(
    voxels: VoxelMap,
    box: Cluster,
    partition: SubspacePartition,
    places_m: Float[ndarray, "n 2"],
    lost: Sequence[Lost],
    camera_range_m: float,
) -> UnseenReason:
    lower, upper = _corners(voxels, box)
    nearest_m = _nearest_m(places_m, lower, upper)
    for reason, lost_m in lost:
        if _nearest_m(lost_m, lower, upper) < min(nearest_m, camera_range_m):
            return reason
    record = partition.records.get(partition.key_of((lower + upper)[:2] / 2))
    if record is not None and record.state is SubspaceState.RECONSTRUCTING:
        return UnseenReason.INTERRUPTED
    if record is not None and record.exhausted is not None:
        return record.exhausted
    in_range = nearest_m <= camera_range_m
    return UnseenReason.BELOW_THRESHOLD if in_range else UnseenReason.UNREACHABLE


def _nearest_m(
    places_m: Float[ndarray, "n 2"], lower_m: Float[ndarray, " 3"], upper_m: Float[ndarray, " 3"]
) -> float:
    """From a box on the floor plane to the nearest place; +inf without any."""
    outside = np.maximum(np.maximum(lower_m[:2] - places_m, places_m - upper_m[:2]), 0.0)
    return float(np.min(np.hypot(outside[:, 0], outside[:, 1]), initial=np.inf))


def _dismissed(voxels: VoxelMap) -> Bool[ndarray, "nx ny nz"]:
    """Unobserved voxels beside free space that were looked at in vain too often."""
    free = voxels.states == VoxelState.FREE
    beside = np.zeros_like(free)
    for axis in range(3):
        ahead = [slice(None)] * 3
        behind = [slice(None)] * 3
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        beside[tuple(ahead)] |= free[tuple(behind)]
        beside[tuple(behind)] |= free[tuple(ahead)]
    unobserved = voxels.states == VoxelState.UNOBSERVED
    dismissed: Bool[ndarray, "nx ny nz"] = (
        unobserved & beside & (voxels.attempts >= voxels.config.max_attempts)
    )
    return dismissed


def _openings(voxels: VoxelMap) -> Bool[ndarray, "nx ny nz"]:
    """Free voxels on the four upright sides of the map's box: space goes on behind them."""
    border = np.zeros(voxels.states.shape, dtype=bool)
    border[[0, -1]] = True
    border[:, [0, -1]] = True
    openings: Bool[ndarray, "nx ny nz"] = border & (voxels.states == VoxelState.FREE)
    return openings
