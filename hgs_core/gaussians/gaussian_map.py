"""The Gaussian map: named fields over arrays that grow in blocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
from jaxtyping import Bool, Float32, Int32, UInt16
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.errors import MapError
from hgs_core.geometry.se3 import SE3

BLOCK: Final = 256
"""Gaussians a block: culling tests a block's bounds before any Gaussian in it."""

N_PARAMETERS: Final = 8

Primitive = Literal["isotropic", "disc"]
"""What the Gaussians of a map are: balls that look the same from everywhere (SplaTAM, HGS-Planner Eq. 1), or
discs that lie on the surface, with one radius, no thickness and a normal (2D Gaussian splatting, Huang et al.
2024, with both axes alike). `rasterise.hpp` says how either looks on the screen."""

_N_NORMAL: Final[dict[str, int]] = {"isotropic": 0, "disc": 3}
"""Columns of `GaussianMap.normals`."""

CENTRE: Final = slice(0, 3)
"""Columns of `parameters`: centre in the world [m]."""
RGB: Final = slice(3, 6)
"""Columns of `parameters`: colour, 0..1."""
LOG_RADIUS: Final = 6
"""Column of `parameters`: natural logarithm of the radius [m]."""
LOGIT_OPACITY: Final = 7
"""Column of `parameters`: logit of the opacity."""


@dataclass(kw_only=True, eq=False)
class GaussianMap:
    """Gaussians of one `primitive`, 8 parameters each (discs: and a normal), and what is known of each.

    Rows `0..size-1` of every array are in use; the rest is room to grow. Rows keep their order; new rows go
    to the end. Sorting new rows by place before `append` keeps each block of `BLOCK` rows compact.
    The mapper is the only writer; readers take `size` once and slice.
    """

    primitive: Primitive = "isotropic"
    size: int = 0
    version: int = 0
    """Raised by every change."""
    parameters: Float32[ndarray, "capacity 8"] = field(
        default_factory=lambda: np.zeros((0, N_PARAMETERS), np.float32)
    )
    normals: Float32[ndarray, "capacity n_normal"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float32)
    )
    """Of discs: unit normals in the world, of either sign, (capacity, 3). Isotropic: (capacity, 0)."""
    adam_first_moment: Float32[ndarray, "capacity 8"] = field(
        default_factory=lambda: np.zeros((0, N_PARAMETERS), np.float32)
    )
    adam_second_moment: Float32[ndarray, "capacity 8"] = field(
        default_factory=lambda: np.zeros((0, N_PARAMETERS), np.float32)
    )
    normal_first_moment: Float32[ndarray, "capacity n_normal"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float32)
    )
    normal_second_moment: Float32[ndarray, "capacity n_normal"] = field(
        default_factory=lambda: np.zeros((0, 0), np.float32)
    )
    adam_steps: Int32[ndarray, " capacity"] = field(default_factory=lambda: np.zeros(0, np.int32))
    information: Float32[ndarray, "capacity 8"] = field(
        default_factory=lambda: np.zeros((0, N_PARAMETERS), np.float32)
    )
    """H_train: diagonal Fisher information of each parameter, summed over all frames (HGS-Planner Eq. 9)."""
    anchor_keyframe: Int32[ndarray, " capacity"] = field(default_factory=lambda: np.zeros(0, np.int32))
    """The keyframe whose depth placed the Gaussian."""
    n_depth_observations: UInt16[ndarray, " capacity"] = field(default_factory=lambda: np.zeros(0, np.uint16))
    """How many depth images have been averaged into the centre."""
    block_bounds: Float32[ndarray, "n_blocks 6"] = field(default_factory=lambda: np.zeros((0, 6), np.float32))
    """Lower and upper corner [m] of the centres of each block, widened by its largest radius."""

    def __post_init__(self) -> None:
        if self.primitive not in _N_NORMAL:
            raise MapError(f"no primitive {self.primitive!r}; there are: {', '.join(_N_NORMAL)}")
        for name in _BY_NORMAL:
            if len(getattr(self, name)) == 0:
                setattr(self, name, np.zeros((0, _N_NORMAL[self.primitive]), np.float32))

    def __len__(self) -> int:
        return self.size

    @property
    def centres_m(self) -> Float32[ndarray, "size 3"]:
        return self.parameters[: self.size, CENTRE]

    @property
    def rgb(self) -> Float32[ndarray, "size 3"]:
        return self.parameters[: self.size, RGB]

    @property
    def radii_m(self) -> Float32[ndarray, " size"]:
        radii: Float32[ndarray, " size"] = np.exp(self.parameters[: self.size, LOG_RADIUS])
        return radii

    @property
    def opacities(self) -> Float32[ndarray, " size"]:
        logits = self.parameters[: self.size, LOGIT_OPACITY]
        opacities: Float32[ndarray, " size"] = 1.0 / (1.0 + np.exp(-logits))
        return opacities

    def append(
        self,
        parameters: Float32[ndarray, "n 8"],
        normals: Float32[ndarray, "n n_normal"] | None = None,
        *,
        anchor_keyframe: int,
    ) -> None:
        """Add rows with no history: moments, information and counts start at zero (one depth observation).

        Discs, and they alone, need `normals` (n, 3). Raises `MapError` otherwise.
        """
        n_normal = _N_NORMAL[self.primitive]
        given = np.zeros((len(parameters), 0), np.float32) if normals is None else normals
        if given.shape != (len(parameters), n_normal):
            raise MapError(
                f"{len(parameters)} Gaussians of a map of primitive {self.primitive!r} need normals of shape "
                f"({len(parameters)}, {n_normal}), got {given.shape}"
            )
        first, last = self.size, self.size + len(parameters)
        self._reserve(last)
        self.parameters[first:last] = parameters
        self.normals[first:last] = given
        for name in _HISTORY:
            getattr(self, name)[first:last] = 0
        self.anchor_keyframe[first:last] = anchor_keyframe
        self.n_depth_observations[first:last] = 1
        self.size = last
        self.version += 1
        self.refresh_blocks(first // BLOCK)

    def keep(self, kept: Bool[ndarray, " size"]) -> None:
        """Drop every row where `kept` is false; the others move up, order unchanged."""
        if kept.shape != (self.size,):
            raise MapError(f"keep needs one flag a Gaussian ({self.size}), got {kept.shape}")
        for name in _ROWS:
            rows = getattr(self, name)[: self.size]
            if rows.size > 0:
                kernels.compact_rows(rows.view(np.uint8).reshape(self.size, -1), kept)
        self.size = int(np.count_nonzero(kept))
        self.version += 1
        self.refresh_blocks(0)

    def move_with_keyframes(self, motions: Mapping[int, SE3]) -> int:
        """Move the Gaussians of each keyframe rigidly by its motion in the world. Returns how many moved.

        What is known of a centre and a normal turns with them: the optimiser's moments, and information as
        the diagonal of the turned (diagonal) matrix. Those of no keyframe (-1) and of others stay.
        """
        if not motions:
            return 0
        keyframes = np.array(sorted(motions), dtype=np.int32)
        anchors = self.anchor_keyframe[: self.size]
        moved = np.isin(anchors, keyframes)
        which = np.searchsorted(keyframes, anchors[moved])
        rotation = np.array([motions[int(k)].rotation for k in keyframes])[which]
        translation = np.array([motions[int(k)].translation for k in keyframes])[which]
        for name in ("parameters", "adam_first_moment"):
            rows = getattr(self, name)[: self.size]
            centres = rows[moved, CENTRE].astype(np.float64)
            turned = np.einsum("nij,nj->ni", rotation, centres)
            rows[moved, CENTRE] = turned + translation if name == "parameters" else turned
        for name in ("adam_second_moment", "information"):
            rows = getattr(self, name)[: self.size]
            rows[moved, CENTRE] = np.einsum("nij,nj->ni", rotation**2, rows[moved, CENTRE])
        if self.normals.shape[1] > 0:
            for name, turn in (
                ("normals", rotation),
                ("normal_first_moment", rotation),
                ("normal_second_moment", rotation**2),
            ):
                rows = getattr(self, name)[: self.size]
                rows[moved] = np.einsum("nij,nj->ni", turn, rows[moved])
        self.version += 1
        self.refresh_blocks()
        return int(np.count_nonzero(moved))

    def refresh_blocks(self, first_block: int = 0) -> None:
        """Recompute `block_bounds` from block `first_block` on."""
        n_blocks = -(-self.size // BLOCK)
        bounds = np.empty((n_blocks, 6), np.float32)
        bounds[:first_block] = self.block_bounds[:first_block]
        rows = self.parameters[first_block * BLOCK : self.size]
        kernels.bound_blocks(rows, BLOCK, bounds[first_block:])
        self.block_bounds = bounds

    def state(self) -> dict[str, Any]:
        """Everything needed to go on: numbers, and views of the arrays. Whoever keeps them beyond the next
        change of the map copies them."""
        arrays = {name: getattr(self, name)[: self.size] for name in _ROWS}
        bounds = {"block_bounds": self.block_bounds}
        return {"primitive": self.primitive, "version": self.version, **arrays, **bounds}

    @staticmethod
    def restore(state: dict[str, Any]) -> GaussianMap:
        restored = GaussianMap(primitive=state["primitive"], version=state["version"])
        restored.size = len(state["parameters"])
        # Bounds only grow while Gaussians move: made anew they would be tighter than those that were saved.
        for name in (*_ROWS, "block_bounds"):
            setattr(restored, name, state[name].copy())
        return restored

    def _reserve(self, needed: int) -> None:
        capacity = len(self.parameters)
        if needed <= capacity:
            return
        grown = max(needed, int(capacity * 1.5), 64 * BLOCK)
        for name in _ROWS:
            old = getattr(self, name)
            new = np.zeros((grown, *old.shape[1:]), old.dtype)
            new[: self.size] = old[: self.size]
            setattr(self, name, new)


_HISTORY: Final = (
    "adam_first_moment",
    "adam_second_moment",
    "normal_first_moment",
    "normal_second_moment",
    "adam_steps",
    "information",
)
_BY_NORMAL: Final = ("normals", "normal_first_moment", "normal_second_moment")
_ROWS: Final = ("parameters", "normals", *_HISTORY, "anchor_keyframe", "n_depth_observations")
