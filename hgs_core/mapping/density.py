"""How many Gaussians a piece of surface may hold."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from jaxtyping import Bool, Float32, Int, Int32
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import CENTRE
from hgs_core.native import kernels
from hgs_core.voxels.voxel_map import VoxelMap

_NO_VOXEL: Final = np.zeros(0, np.int64)


class SurfaceDensity:
    """Gaussians a voxel, counted now and then, and a budget that new ones have to fit in.

    A plane has at most 1.3 s^2 within a voxel of edge s, so a budget a square metre is, to within that
    factor, one a voxel of s^2 square metres. What leaves the map between two counts is still counted.
    """

    def __init__(self, *, max_per_m2: float) -> None:
        self._max_per_m2 = max_per_m2
        self._size_m = 1.0
        self._lower: Int[ndarray, " 3"] = np.zeros(3, np.int64)
        self._counts: Int32[ndarray, "nx ny nz"] = np.zeros((0, 0, 0), np.int32)

    def recount(
        self, parameters: Float32[ndarray, "n 8"], voxels: VoxelMap, *, min_logit_opacity: float
    ) -> None:
        """Count these Gaussians, the whole map, anew by the voxels there are now; fainter ones are none."""
        self._size_m = voxels.config.size_m
        self._lower = voxels.origin_index.copy()
        self._counts = np.zeros(voxels.states.shape, np.int32)
        kernels.count_by_voxel(
            parameters, min_logit_opacity, tuple(self._lower.tolist()), self._size_m, self._counts
        )

    def admit(self, parameters: Float32[ndarray, "n 8"]) -> Bool[ndarray, " n"]:
        """Which of these new Gaussians fit in, the first of a voxel first; they are counted from now on.

        In voxels beyond those of the last count all fit in.
        """
        budget = max(1, round(self._max_per_m2 * self._size_m**2))
        centres = parameters[:, CENTRE].astype(np.float64)
        voxel = np.floor(centres / self._size_m).astype(np.int64) - self._lower
        inside = np.all((voxel >= 0) & (voxel < self._counts.shape), axis=1)
        flat = np.ravel_multi_index(tuple(voxel[inside].T), self._counts.shape) if inside.any() else _NO_VOXEL
        counts = self._counts.reshape(-1)
        admitted: Bool[ndarray, " n"] = np.ones(len(parameters), bool)
        admitted[inside] = _rank_in_group(flat) < budget - counts[flat]
        np.add.at(counts, flat[admitted[inside]], 1)
        return admitted

    def state(self) -> dict[str, Any]:
        return {"size_m": self._size_m, "lower": self._lower.copy(), "counts": self._counts.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        self._size_m = state["size_m"]
        self._lower = state["lower"].copy()
        self._counts = state["counts"].copy()


def _rank_in_group(group: Int[ndarray, " n"]) -> Int[ndarray, " n"]:
    """0 for the first of each group, 1 for the second, and so on."""
    order = np.argsort(group, kind="stable")
    ordered = group[order]
    is_first = np.ones(len(group), bool)
    is_first[1:] = ordered[1:] != ordered[:-1]
    position = np.arange(len(group))
    start = np.maximum.accumulate(np.where(is_first, position, 0))
    rank = np.empty(len(group), np.int64)
    rank[order] = position - start
    return rank
