"""The maps as a mission with a region of interest sees them: what lies outside is worth nothing."""

from __future__ import annotations

import copy
from typing import Final

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap

_ALL_THERE_IS: Final = np.float32(1e30)
"""Information of a Gaussian that no view can add to."""


class Focus:
    """Shows snapshots to gains and planners so that whatever they measure counts inside the region alone.

    Outside, unobserved voxels are dismissed and Gaussians are fully known: both still hide what is behind
    them. No gain has to know of regions.
    """

    def __init__(self) -> None:
        self._voxels: VoxelMap | None = None
        self._gaussians = GaussianMap()
        self._shown_of: MapSnapshot | None = None
        self._shown: MapSnapshot | None = None

    def on(self, snapshot: MapSnapshot, inside: Bool[ndarray, "nx ny"]) -> MapSnapshot:
        """`snapshot` with only the columns `inside` worth seeing; valid as long as it is."""
        known = self._voxels is not None and self._voxels.interest is inside
        if self._shown is not None and known and snapshot.is_same(self._shown_of):
            return self._shown
        self._voxels = snapshot.voxels.focused(inside, self._voxels)
        self._gaussians = _known_outside(snapshot.gaussians, self._voxels, inside)
        self._shown_of = snapshot
        self._shown = MapSnapshot(
            gaussians=self._gaussians,
            voxels=self._voxels,
            version=snapshot.version,
            timestamp_s=snapshot.timestamp_s,
        )
        return self._shown


def _known_outside(gaussians: GaussianMap, voxels: VoxelMap, inside: Bool[ndarray, "nx ny"]) -> GaussianMap:
    """The Gaussians, sharing all but the information, of which those outside have all there is."""
    shown = copy.copy(gaussians)
    columns, in_map = voxels.index_of(gaussians.centres_m.astype(np.float64))
    counts = np.zeros(gaussians.size, bool)
    counts[in_map] = inside[columns[in_map, 0], columns[in_map, 1]]
    shown.information = gaussians.information.copy()
    shown.information[: gaussians.size][~counts] = _ALL_THERE_IS
    return shown
