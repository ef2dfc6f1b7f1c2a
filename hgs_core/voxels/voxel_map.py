"""The voxel map: what has been observed, what is free, what is missing."""

from __future__ import annotations

import copy
from enum import IntEnum
from typing import Any, Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32, Int64, UInt8
from numpy import ndarray
from pydantic import Field

import hgs_core.native.kernels as kernels
from hgs_core.config.base import StrictConfig
from hgs_core.errors import MapError
from hgs_core.geometry.boxes import Box
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.rays import RayEnds, frame_rays, scan_rays

GROWTH_STEP: Final = np.array([64, 64, 16])
"""A growing map's bounds are multiples of these [voxels]: rooms are wide and low."""

MAX_VOXELS: Final = 1_000_000_000
"""A map that would grow beyond this is a sign of broken poses, not of a large building."""


CHUNK: Final[int] = kernels.VOXEL_CHUNK
"""Edge of a chunk, in voxels: changes are kept account of by so many columns together."""


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
    max_attempts: int = Field(3, ge=1, le=255)
    """After so many looks in vain an unobserved voxel is dismissed (occluded)."""


class VoxelMap:
    """Log-odds occupancy over a box of cubic voxels, indexed by `floor(p / size_m)` (half-open cells).

    `states[i, j, k]` is the voxel with global index `origin_index + (i, j, k)`. With a `region` the box is
    fixed to it (widened to whole voxels); without, it grows as observations leave it (`origin_index` and
    the shape then change).

    *Missing* voxels: unobserved, with a free face-neighbour, looked at in vain fewer than `max_attempts`
    times, in 26-connected clusters of at least `min_missing_cluster`. Only these keep a mission alive:
    the insides of walls and furniture never have a free neighbour, or are dismissed.

    A frame *looks in vain* at an unobserved voxel with a free face-neighbour when the voxel's centre lies in
    the image and within range, every voxel between the camera and it is free, and yet the depth measured at
    its pixel ends before it: the map's resolution hides what blocks the view, and looking again will not
    help. Pixels without a return, and rays that merely fell between the sampled pixels, do not count.
    """

    config: VoxelConfig
    version: int
    origin_index: Int[ndarray, " 3"]
    states: UInt8[ndarray, "nx ny nz"]
    """`VoxelState` of each voxel."""
    log_odds: Float32[ndarray, "nx ny nz"]
    attempts: UInt8[ndarray, "nx ny nz"]
    """Looks in vain at each voxel (saturates at 255)."""
    n_observed: int
    """Voxels that are not unobserved any more."""
    interest: Bool[ndarray, "nx ny"] | None = None
    """The columns that are worth seeing (see `focused`); None: all."""
    changed_at: Int64[ndarray, "n_chunks_x n_chunks_y"]
    """The version at which any state or attempt of each chunk of columns last changed; 0: never."""
    _missing: Bool[ndarray, "nx ny nz"]
    _missing_in_columns: Int32[ndarray, "nx ny"]
    _n_missing: int
    _missing_version: int
    """The version that these were last brought up to."""

    def __init__(self, config: VoxelConfig, *, region: Box | None = None) -> None:
        self.config = config
        self.version = 0
        self._fixed = region is not None
        if region is None:
            self._allocate(np.zeros(3, np.int64), np.zeros(3, np.int64))
        else:
            # Bounds given in decimals (1.2 m at 0.1 m) shall not gain a layer through rounding.
            lower = np.floor(region.lower_m / config.size_m + 1e-6).astype(np.int64)
            upper = np.ceil(region.upper_m / config.size_m - 1e-6).astype(np.int64)
            self._allocate(lower, np.maximum(upper, lower + 1))

    def integrate_frame(self, frame: Frame, *, range_m: float, pixel_stride: int | None = None) -> None:
        """Rays to measured depth carve free space and mark their ends; +inf carves to `range_m` (z-depth);
        0 does nothing. Each voxel is updated at most once a frame; a hit beats a pass.

        `pixel_stride`: instead of the settings', for images of another size than theirs.
        """
        stride = self.config.pixel_stride if pixel_stride is None else pixel_stride
        self._integrate(frame_rays(frame, range_m=range_m, pixel_stride=stride))
        camera = frame.intrinsics
        changed = self._no_chunks()
        kernels.count_attempts(
            self.states,
            self.attempts,
            np.ascontiguousarray(frame.T_world_camera.rotation, np.float64),
            self._cells(frame.T_world_camera.translation),
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            np.ascontiguousarray(frame.depth_m),
            range_m,
            self.config.size_m,
            float(stride),
            changed,
        )
        self.version += 1
        self.changed_at[changed != 0] = self.version

    def integrate_scan(self, scan: Scan, *, range_m: float) -> None:
        """As `integrate_frame`, for the rays of a planar scan (`range_m` along the ray; no looks in vain)."""
        self._integrate(scan_rays(scan, range_m=range_m))
        self.version += 1

    def begun_anew(self) -> VoxelMap:
        """A map of the same settings and region in which nothing has been observed, and whose versions come
        after this one's. Looks in vain are forgotten."""
        anew = copy.copy(self)
        lower, shape = self.origin_index.copy(), np.array(self.states.shape)
        anew._allocate(lower, lower + shape)
        anew.note_change()
        return anew

    def note_change(self) -> None:
        """To be called by whoever wrote to the arrays: anything may have changed."""
        self.version += 1
        self.changed_at[:] = self.version
        self.n_observed = int(np.count_nonzero(self.states))

    def focused(self, interest: Bool[ndarray, "nx ny"], before: VoxelMap | None) -> VoxelMap:
        """This map where only the columns of `interest` are worth seeing: elsewhere every unobserved voxel
        counts as dismissed, so that it is neither missing nor a gain.

        It shares all but `attempts` with this map, and is valid as long as a snapshot of it. `before`: what
        this gave last for the same columns; only what has changed since is done again, in place.
        """
        if before is None or before.interest is not interest or before.states.shape != self.states.shape:
            before = copy.copy(self)
            before.interest = interest
            before.attempts = np.where(interest[..., None], self.attempts, np.uint8(255))
            before._forget_missing()
        else:
            box = self.changed_columns(before.version)
            if box is not None:
                (i0, j0), (i1, j1) = box
                here = (slice(i0, i1), slice(j0, j1))
                before.attempts[here] = np.where(interest[here][..., None], self.attempts[here], 255)
            before.states, before.log_odds, before.changed_at = self.states, self.log_odds, self.changed_at
            before.version, before.n_observed = self.version, self.n_observed
        return before

    def missing(self) -> Bool[ndarray, "nx ny nz"]:
        """The missing voxels. Valid until the next change of the map: renewed in place, where it changed."""
        self._renew_missing()
        return self._missing

    @property
    def n_missing(self) -> int:
        """How many voxels are missing."""
        self._renew_missing()
        return self._n_missing

    def changed_columns(self, since_version: int) -> tuple[tuple[int, int], tuple[int, int]] | None:
        """A box of columns, `low <= index < high`, that holds everything that changed after a version;
        `None` when nothing did."""
        chunks_i, chunks_j = np.nonzero(self.changed_at > since_version)
        if not len(chunks_i):
            return None
        nx, ny, _ = self.states.shape
        low = (int(chunks_i.min()) * CHUNK, int(chunks_j.min()) * CHUNK)
        high = (int(chunks_i.max() + 1) * CHUNK, int(chunks_j.max() + 1) * CHUNK)
        return low, (min(high[0], nx), min(high[1], ny))

    def count_in_columns(
        self, low: tuple[int, int, int], high: tuple[int, int, int]
    ) -> Int32[ndarray, "nx ny 3"]:
        """Voxels of each `VoxelState` in the columns of the box of array indices `low <= index < high`."""
        counts = np.empty((high[0] - low[0], high[1] - low[1], 3), np.int32)
        kernels.count_in_columns(self.states, low, high, counts)
        return counts

    def missing_in_columns(self) -> Int32[ndarray, "nx ny"]:
        """Missing voxels of each column. Valid as long as `missing()`."""
        self._renew_missing()
        return self._missing_in_columns

    def lower_m(self) -> Float[ndarray, " 3"]:
        """World position of the low corner of `states[0, 0, 0]`."""
        lower: Float[ndarray, " 3"] = self.origin_index * self.config.size_m
        return lower

    def index_of(self, points_m: Float[ndarray, "n 3"]) -> tuple[Int[ndarray, "n 3"], Bool[ndarray, " n"]]:
        """Array indices of points, and which lie inside."""
        indices = np.floor(points_m / self.config.size_m).astype(np.int64) - self.origin_index
        inside: Bool[ndarray, " n"] = np.all((indices >= 0) & (indices < self.states.shape), axis=1)
        return indices, inside

    def centres_m(self, indices: Int[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """World positions of the centres of voxels given by array indices."""
        centres: Float[ndarray, "n 3"] = (indices + self.origin_index + 0.5) * self.config.size_m
        return centres

    def observed_share(self, box: Box) -> float:
        """lambda_o of HGS-Planner Eq. 10: observed voxels over all voxels where the box meets the map.

        Unknown rooms count whole, not by the voxels at their borders alone: these are so few that the share
        would hardly ever leave 0.9. The insides of walls and furniture count, too, so that it stays below 1.
        A voxel belongs to the box when its centre does; 0 where they do not meet.
        """
        size = self.config.size_m
        first = np.ceil(box.lower_m / size - 0.5).astype(np.int64) - self.origin_index
        last = np.ceil(box.upper_m / size - 0.5).astype(np.int64) - self.origin_index
        inside = tuple(slice(max(int(a), 0), max(int(b), 0)) for a, b in zip(first, last, strict=True))
        states = self.states[inside]
        return np.count_nonzero(states) / states.size if states.size else 0.0

    def state(self) -> dict[str, Any]:
        """Everything needed to go on: plain arrays and numbers."""
        return {
            "config": self.config.model_dump(),
            "fixed": self._fixed,
            "version": self.version,
            "origin_index": self.origin_index.copy(),
            "states": self.states.copy(),
            "log_odds": self.log_odds.copy(),
            "attempts": self.attempts.copy(),
        }

    @staticmethod
    def restore(state: dict[str, Any]) -> VoxelMap:
        restored = VoxelMap(VoxelConfig(**state["config"]))
        restored._fixed = state["fixed"]
        restored.version = state["version"]
        shape = np.array(state["states"].shape)
        restored._allocate(state["origin_index"].copy(), state["origin_index"] + shape)
        for name in _VOXEL_ARRAYS:
            setattr(restored, name, state[name].copy())
        restored.changed_at[:] = restored.version
        restored.n_observed = int(np.count_nonzero(restored.states))
        return restored

    def _cells(self, points_m: Float[ndarray, "*n 3"]) -> Float[ndarray, "*n 3"]:
        """Points in the kernels' coordinates: cells of the arrays."""
        cells: Float[ndarray, "*n 3"] = np.ascontiguousarray(
            points_m / self.config.size_m - self.origin_index
        )
        return cells

    def _integrate(self, rays: RayEnds) -> None:
        if not self._fixed:
            self._grow(rays)
        changed = self._no_chunks()
        self.n_observed += kernels.integrate_rays(
            self.states,
            self.log_odds,
            self._cells(rays.origin_m),
            self._cells(rays.ends_m),
            rays.is_hit,
            self.config.log_odds_hit,
            self.config.log_odds_miss,
            *self.config.log_odds_limits,
            changed,
        )
        self.changed_at[changed != 0] = self.version + 1

    def _no_chunks(self) -> UInt8[ndarray, "n_chunks_x n_chunks_y"]:
        return np.zeros(self.changed_at.shape, np.uint8)

    def _renew_missing(self) -> None:
        box = self.changed_columns(self._missing_version)
        if box is not None:
            self._n_missing += kernels.renew_missing(
                self.states,
                self.attempts,
                self.config.max_attempts,
                self.config.min_missing_cluster,
                *box,
                self._missing,
                self._missing_in_columns,
            )
        self._missing_version = self.version

    def _allocate(self, lower: Int[ndarray, " 3"], upper: Int[ndarray, " 3"]) -> None:
        shape = tuple(int(n) for n in upper - lower)
        if np.prod(upper - lower, dtype=float) > MAX_VOXELS:
            raise MapError(
                f"a voxel map of {shape} voxels of {self.config.size_m} m exceeds {MAX_VOXELS}: "
                "check the poses, give a region, or use larger voxels"
            )
        self.origin_index = lower
        self.states = np.zeros(shape, np.uint8)
        self.log_odds = np.zeros(shape, np.float32)
        self.attempts = np.zeros(shape, np.uint8)
        self.n_observed = 0
        self.changed_at = np.zeros((-(-shape[0] // CHUNK), -(-shape[1] // CHUNK)), np.int64)
        self._forget_missing()

    def _forget_missing(self) -> None:
        """Find all missing voxels anew when next asked for them."""
        shape = self.states.shape
        self._missing = np.zeros(shape, bool)
        self._missing_in_columns = np.zeros(shape[:2], np.int32)
        self._n_missing = 0
        self._missing_version = -1

    def _grow(self, rays: RayEnds) -> None:
        """Make room for the rays; what is known moves along."""
        points = np.vstack([rays.origin_m, rays.ends_m])
        lowest = np.floor(points.min(axis=0) / self.config.size_m).astype(np.int64)
        highest = np.floor(points.max(axis=0) / self.config.size_m).astype(np.int64) + 1
        old_lower = self.origin_index
        old_upper = old_lower + self.states.shape
        if self.states.size == 0:
            old_lower, old_upper = lowest, highest
        elif np.all(lowest >= old_lower) and np.all(highest <= old_upper):
            return
        lower = np.minimum(old_lower, lowest // GROWTH_STEP * GROWTH_STEP)
        upper = np.maximum(old_upper, -(-highest // GROWTH_STEP) * GROWTH_STEP)
        kept = {name: getattr(self, name) for name in _VOXEL_ARRAYS}
        n_observed = self.n_observed
        self._allocate(lower, upper)
        self.n_observed = n_observed
        self.changed_at[:] = self.version + 1
        if kept["states"].size == 0:
            return
        place = tuple(
            slice(int(a), int(b)) for a, b in zip(old_lower - lower, old_upper - lower, strict=True)
        )
        for name, array in kept.items():
            getattr(self, name)[place] = array


_VOXEL_ARRAYS: Final = ("states", "log_odds", "attempts")
