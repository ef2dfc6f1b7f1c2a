"""The voxel map: what has been observed, what is free, what is missing."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.boxes import Box
from hgs_core.sensing.frame import Frame, Scan
from jaxtyping import Bool, Float, Float32, Int, UInt8
from numpy import ndarray
from pydantic import Field


class VoxelState(IntEnum):
    UNOBSERVED = 0
    FREE = 1
    OCCUPIED = 2


class VoxelConfig(StrictConfig):
    size_m: float = Field(0.1, gt=0)
    """Edge of a voxel [m]."""
    log_odds_hit: float = Field(0.85, gt=0)
    log_odds_miss: float = Field(-0.4, lt=0)
    log_odds_limits: tuple[float, float] = (-2.0, 3.5)
    pixel_stride: int = Field(4, ge=1)
    """Every how many pixels of a depth image a ray is integrated."""
    min_missing_cluster: int = Field(8, ge=1)
    """Missing voxels in smaller connected clusters (26-neighbours) do not count as missing."""
    max_attempts: int = Field(3, ge=1)
    """After so many clear lines of sight without an observation an unobserved voxel is dismissed (occluded)."""


class VoxelMap:
    """Log-odds occupancy over a box of cubic voxels, indexed by `floor(p / size_m)` (half-open cells).

    `states[i, j, k]` is the voxel with global index `origin_index + (i, j, k)`. With a `region` the box is
    fixed to it; without, it grows as observations leave it (`origin_index` and the shape then change).

    *Missing* voxels: unobserved, with a free face-neighbour, looked at in vain fewer than `max_attempts`
    times, in 26-connected clusters of at least `min_missing_cluster`. Only these keep a mission alive:
    the insides of walls and furniture never have a free neighbour, or are dismissed.
    """

    config: VoxelConfig
    version: int
    origin_index: Int[ndarray, " 3"]
    states: UInt8[ndarray, "nx ny nz"]
    """`VoxelState` of each voxel."""
    log_odds: Float32[ndarray, "nx ny nz"]
    attempts: UInt8[ndarray, "nx ny nz"]
    """Clear lines of sight that ended without an observation."""

    def __init__(self, config: VoxelConfig, *, region: Box | None = None) -> None: ...

    def integrate_frame(self, frame: Frame, *, range_m: float) -> None:
        """Rays to measured depth carve free space and mark their ends; +inf carves to `range_m` (z-depth);
        0 does nothing. Each voxel is updated at most once a frame; a hit beats a pass."""

    def integrate_scan(self, scan: Scan, *, range_m: float) -> None: ...

    def missing(self) -> Bool[ndarray, "nx ny nz"]:
        """The missing voxels (cached by `version`)."""

    def lower_m(self) -> Float[ndarray, " 3"]:
        """World position of the low corner of `states[0, 0, 0]`."""

    def index_of(self, points_m: Float[ndarray, "n 3"]) -> tuple[Int[ndarray, "n 3"], Bool[ndarray, " n"]]:
        """Array indices of points, and which lie inside."""

    def centres_m(self, indices: Int[ndarray, "n 3"]) -> Float[ndarray, "n 3"]: ...

    def observed_share(self, box: Box) -> float:
        """lambda_o of HGS-Planner Eq. 10: observed voxels over observed + missing voxels in the box's
        intersection with the map. (Never-visible insides are left out; 0 when nothing is observed.)"""

    def state(self) -> dict[str, Any]: ...

    @staticmethod
    def restore(state: dict[str, Any]) -> VoxelMap: ...
