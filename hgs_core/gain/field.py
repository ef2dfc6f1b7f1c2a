"""What each voxel near the viewpoints means to a ray: how opaque it is, and whether seeing it is a gain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int64
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap

MIN_OPACITY: Final = 0.005
"""Fainter Gaussians are on their way out of the map and count for nothing."""

OPTICAL_DEPTH, UNSEEN = 0, 1
"""Channels of `GainField.cells`."""


CHUNK: Final[int] = kernels.GAIN_CHUNK
"""Edge of a chunk, in voxels: so many by so many columns are gathered together."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GainField:
    """The voxels of a map, gathered chunk by chunk where they are asked for.

    `cells[..., 0]` is a voxel's optical depth over one edge length; `cells[..., 1]` is 0 where seeing it is
    no gain, elsewhere how full of surface it is likely to be: 1 is as full as unobserved space in the mean.
    """

    first_index: Int[ndarray, " 3"]
    """Global voxel index of `cells[0, 0, 0]`."""
    size_m: float
    """Edge of a voxel."""
    cells: Float32[ndarray, "nx ny nz 2"]
    n_gaussians: Int64[ndarray, "n_chunks_x n_chunks_y"]
    """Gaussians in each chunk."""
    n_populated: Int64[ndarray, "n_chunks_x n_chunks_y"]
    """Voxels of each chunk that hold any."""
    is_gathered: Bool[ndarray, "n_chunks_x n_chunks_y"]
    """Which chunks hold what the maps hold now."""

    @staticmethod
    def over(voxels: VoxelMap) -> GainField:
        """The field of the whole map, nothing gathered yet."""
        shape = voxels.states.shape
        n_chunks = (-(-shape[0] // CHUNK), -(-shape[1] // CHUNK))
        return GainField(
            first_index=voxels.origin_index.copy(),
            size_m=voxels.config.size_m,
            cells=np.zeros((*shape, 2), np.float32),
            n_gaussians=np.zeros(n_chunks, np.int64),
            n_populated=np.zeros(n_chunks, np.int64),
            is_gathered=np.zeros(n_chunks, bool),
        )

    def is_over(self, voxels: VoxelMap) -> bool:
        """Whether this is a field of the same box of voxels."""
        return voxels.states.shape == self.cells.shape[:3] and bool(
            np.all(voxels.origin_index == self.first_index)
        )

    def chunks_near(
        self, positions_m: Float[ndarray, "n 3"], range_m: float
    ) -> Bool[ndarray, "n_chunks_x n_chunks_y"]:
        """Chunks within a square of half-width `range_m` about any of the positions."""
        near = np.zeros_like(self.is_gathered)
        columns = positions_m[:, :2] / self.size_m - self.first_index[:2]
        reach = range_m / self.size_m
        first = np.maximum(np.floor((columns - reach) / CHUNK).astype(np.int64), 0)
        last = np.maximum(np.floor((columns + reach) / CHUNK).astype(np.int64) + 1, 0)
        for (i, j), (end_i, end_j) in zip(first, last, strict=True):
            near[i:end_i, j:end_j] = True
        return near

    def gather(
        self,
        snapshot: MapSnapshot,
        chunks: Bool[ndarray, "n_chunks_x n_chunks_y"],
        *,
        fullness: Float32[ndarray, " nz"] | None = None,
    ) -> None:
        """Fill those of the chunks that are not gathered yet. The snapshot's voxels are this field's.

        `fullness` is how full of surface the unobserved voxels of each layer are likely to be.

        A Gaussian of opacity `o` and radius `r` adds `2 pi o r^2 / face area` to the optical depth of the
        voxel that holds its centre. Occupied voxels let nothing through whatever their Gaussians, and neither
        do dismissed ones (looked at in vain too often); other unobserved voxels are transparent, as in Eq. 4.
        """
        voxels, gaussians = snapshot.voxels, snapshot.gaussians
        wanted = chunks & ~self.is_gathered
        if not wanted.any():
            return
        kernels.gather_gain(
            gaussians.parameters[: gaussians.size],
            gaussians.block_bounds,
            voxels.states,
            voxels.attempts,
            voxels.config.max_attempts,
            self.first_index * self.size_m,
            self.size_m,
            MIN_OPACITY,
            wanted,
            self.cells,
            self.n_gaussians,
            self.n_populated,
        )
        if fullness is not None:
            nx, ny, _, _ = self.cells.shape
            columns = np.repeat(np.repeat(wanted, CHUNK, axis=0), CHUNK, axis=1)[:nx, :ny]
            self.cells[columns, :, UNSEEN] *= fullness
        self.is_gathered[wanted] = True

    def gaussians_per_m2(self, chunks: Bool[ndarray, "n_chunks_x n_chunks_y"]) -> float:
        """Mean number of Gaussians on a voxel face's area of surface; 0 where there are none."""
        n_populated = int(self.n_populated[chunks].sum())
        if n_populated == 0:
            return 0.0
        return float(self.n_gaussians[chunks].sum()) / n_populated / self.size_m**2
