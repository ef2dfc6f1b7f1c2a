"""Subspaces of the global level: even cuboids and their states (HGS-Planner section III-D).

A cuboid spans the full height of the map. It is *unreconstructed* while nothing in it has been observed,
*reconstructing* while enough is missing, and *reconstructed* when little is missing, or when what is missing
cannot be gained (*exhausted*: the reason is kept). Hysteresis, after TARE: a reconstructed cuboid reopens
only on clear evidence: its missing volume grew by `reopen_volume_m3` beyond the least since it was closed,
or, when it was exhausted, the robot can now stand in many more places near it.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.boxes import Box
from hgs_core.planning.plan import Subspace, SubspaceState, UnseenReason
from hgs_core.voxels.voxel_map import VoxelMap

Key = tuple[int, int]


class SubspaceConfig(StrictConfig):
    edge_m: float = Field(3.0, gt=0)
    """Edge of a cuboid on the floor plane [m]."""
    done_volume_m3: float = Field(0.03, gt=0)
    """With less missing than this a cuboid is reconstructed [m^3]."""
    reopen_volume_m3: float = Field(0.10, gt=0)
    """The missing volume must grow by this much to reopen a reconstructed cuboid [m^3]."""
    reopen_places: int = Field(60, ge=1)
    """An exhausted cuboid reopens when this many more cells near it (and half as many again) can be stood
    on."""


@dataclass(kw_only=True)
class SubspaceRecord:
    """What is known of one cuboid."""

    state: SubspaceState
    missing_volume_m3: float
    least_missing_m3: float = 0.0
    """The least missing volume since it was closed."""
    exhausted: UnseenReason | None = None
    places_at_close: int = 0
    """Cells near it that could be stood on when it was exhausted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MissingInCuboid:
    """Missing voxels of one cuboid."""

    volume_m3: float
    middle_m: Float[ndarray, " 2"]
    """Their mean place on the floor plane."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MissingColumns:
    """Missing voxels summed over height: one entry a column that has any."""

    xy_m: Float[ndarray, "n 2"]
    volume_m3: Float[ndarray, " n"]
    keys: Int[ndarray, "n 2"]

    def gathered(self, counted: Bool[ndarray, " n"]) -> dict[Key, MissingInCuboid]:
        """What the counted columns of each cuboid amount to; cuboids without any are left out."""
        rows = self._order[counted[self._order]]
        keys, volume = self.keys[rows], self.volume_m3[rows]
        starts = np.flatnonzero(np.any(np.diff(keys, axis=0, prepend=keys[:1] - 1) != 0, axis=1))
        if not len(starts):
            return {}
        volumes = np.add.reduceat(volume, starts)
        middles = np.add.reduceat(self.xy_m[rows] * volume[:, None], starts) / volumes[:, None]
        return {
            (i, j): MissingInCuboid(volume_m3=of_key, middle_m=middle)
            for (i, j), of_key, middle in zip(keys[starts].tolist(), volumes.tolist(), middles, strict=True)
        }

    @cached_property
    def _order(self) -> Int[ndarray, " n"]:
        return np.lexsort((self.keys[:, 1], self.keys[:, 0]))


class SubspacePartition:
    """All cuboids that the voxel map has reached, keyed by their index on the floor plane."""

    def __init__(self, config: SubspaceConfig, *, origin_m: Float[ndarray, " 2"]) -> None:
        self.config = config
        self.origin_m = origin_m
        self.records: dict[Key, SubspaceRecord] = {}
        self._height_m = (0.0, 0.0)
        self._seen_until_version = -1
        """The voxel map's version up to which cuboids have been looked at for a first observation."""

    def update(self, voxels: VoxelMap) -> MissingColumns:
        """Bring all states up to the voxel map; returns where voxels are missing."""
        size = voxels.config.size_m
        lower = np.asarray(voxels.lower_m(), dtype=np.float64)
        self._height_m = (float(lower[2]), float(lower[2] + voxels.states.shape[2] * size))
        nx, ny, _ = voxels.states.shape
        column_x = self._index(lower[0] + (np.arange(nx) + 0.5) * size, 0)
        column_y = self._index(lower[1] + (np.arange(ny) + 0.5) * size, 1)
        keys_x, first_i = np.unique(column_x, return_index=True)
        keys_y, first_j = np.unique(column_y, return_index=True)
        in_columns = voxels.missing_in_columns()
        ij = np.argwhere(in_columns)
        n_missing = in_columns[ij[:, 0], ij[:, 1]]
        keys = np.stack([column_x[ij[:, 0]], column_y[ij[:, 1]]], axis=1)
        flat = (keys[:, 0] - keys_x[0]) * len(keys_y) + keys[:, 1] - keys_y[0]
        volume = np.bincount(flat, weights=n_missing, minlength=len(keys_x) * len(keys_y)) * size**3
        changed = voxels.changed_columns(self._seen_until_version)
        self._seen_until_version = voxels.version
        columns_i = list(zip(first_i.tolist(), [*first_i[1:].tolist(), nx], strict=True))
        columns_j = list(zip(first_j.tolist(), [*first_j[1:].tolist(), ny], strict=True))
        cuboids = itertools.product(
            zip(keys_x.tolist(), columns_i, strict=True), zip(keys_y.tolist(), columns_j, strict=True)
        )
        for ((key_x, (i0, i1)), (key_y, (j0, j1))), missing_m3 in zip(cuboids, volume.tolist(), strict=True):
            record = self.records.setdefault(
                (key_x, key_y),
                SubspaceRecord(state=SubspaceState.UNRECONSTRUCTED, missing_volume_m3=0.0),
            )
            seen = record.state is not SubspaceState.UNRECONSTRUCTED or (
                _overlaps(changed, (i0, j0), (i1, j1)) and bool(voxels.states[i0:i1, j0:j1].any())
            )
            self._advance(record, missing_m3, seen)
        return MissingColumns(xy_m=lower[:2] + (ij + 0.5) * size, volume_m3=n_missing * size**3, keys=keys)

    def exhaust(self, key: Key, reason: UnseenReason, *, places: int) -> None:
        """Close a cuboid whose missing voxels cannot be gained."""
        record = self.records[key]
        record.state = SubspaceState.RECONSTRUCTED
        record.exhausted = reason
        record.least_missing_m3 = record.missing_volume_m3
        record.places_at_close = places

    def reconsider(self, key: Key, *, places: int) -> None:
        """Reopen an exhausted cuboid when the robot can stand in clearly more places near it than
        before."""
        record = self.records[key]
        grown = places - record.places_at_close
        if record.exhausted is not None and grown >= max(
            self.config.reopen_places, record.places_at_close // 2
        ):
            self._open(record)

    def reopen_exhausted(self) -> None:
        """What was given up is judged anew."""
        for record in self.records.values():
            if record.exhausted is not None and record.missing_volume_m3 >= self.config.done_volume_m3:
                self._open(record)

    def key_of(self, xy_m: Float[ndarray, " 2"]) -> Key:
        return int(self._index(xy_m[:1], 0)[0]), int(self._index(xy_m[1:2], 1)[0])

    def listing(self) -> tuple[Subspace, ...]:
        """For the plan: every cuboid with its box."""
        edge = self.config.edge_m
        low, high = self._height_m
        x0, y0 = float(self.origin_m[0]), float(self.origin_m[1])
        return tuple(
            Subspace(
                lower_m=(x0 + i * edge, y0 + j * edge, low),
                upper_m=(x0 + (i + 1) * edge, y0 + (j + 1) * edge, high),
                state=record.state,
                missing_volume_m3=record.missing_volume_m3,
            )
            for (i, j), record in sorted(self.records.items())
        )

    def with_state(self, state: SubspaceState) -> list[Key]:
        return sorted(key for key, record in self.records.items() if record.state is state)

    def state(self) -> dict[str, Any]:
        return {
            "height_m": self._height_m,
            "records": [
                {
                    "key": list(key),
                    "state": record.state.value,
                    "missing_volume_m3": record.missing_volume_m3,
                    "least_missing_m3": record.least_missing_m3,
                    "exhausted": None if record.exhausted is None else record.exhausted.value,
                    "places_at_close": record.places_at_close,
                }
                for key, record in sorted(self.records.items())
            ],
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._height_m = (float(state["height_m"][0]), float(state["height_m"][1]))
        self.records = {}
        for entry in state["records"]:
            reason = entry["exhausted"]
            self.records[int(entry["key"][0]), int(entry["key"][1])] = SubspaceRecord(
                state=SubspaceState(entry["state"]),
                missing_volume_m3=float(entry["missing_volume_m3"]),
                least_missing_m3=float(entry["least_missing_m3"]),
                exhausted=None if reason is None else UnseenReason(reason),
                places_at_close=int(entry["places_at_close"]),
            )
        self._seen_until_version = -1

    def _index(self, coordinate_m: Float[ndarray, " n"], axis: int) -> Int[ndarray, " n"]:
        return np.floor((coordinate_m - self.origin_m[axis]) / self.config.edge_m).astype(np.int64)

    def _advance(self, record: SubspaceRecord, missing_m3: float, seen: bool) -> None:
        record.missing_volume_m3 = missing_m3
        if record.state is SubspaceState.UNRECONSTRUCTED:
            if seen and missing_m3 >= self.config.done_volume_m3:
                record.state = SubspaceState.RECONSTRUCTING
            elif seen:
                self._close(record)
        elif record.state is SubspaceState.RECONSTRUCTING:
            if missing_m3 < self.config.done_volume_m3:
                self._close(record)
        elif missing_m3 >= record.least_missing_m3 + self.config.reopen_volume_m3:
            self._open(record)
        else:
            record.least_missing_m3 = min(record.least_missing_m3, missing_m3)

    @staticmethod
    def _open(record: SubspaceRecord) -> None:
        record.state = SubspaceState.RECONSTRUCTING
        record.exhausted = None

    @staticmethod
    def _close(record: SubspaceRecord) -> None:
        record.state = SubspaceState.RECONSTRUCTED
        record.exhausted = None
        record.least_missing_m3 = record.missing_volume_m3


def _overlaps(
    box: tuple[tuple[int, int], tuple[int, int]] | None, low: tuple[int, int], high: tuple[int, int]
) -> bool:
    """Whether two boxes of columns share any."""
    return box is not None and all(
        a < d and c < b for (a, b), c, d in zip(zip(*box, strict=True), low, high, strict=True)
    )


def horizon_around(xy_m: Float[ndarray, " 2"], edge_m: float, voxels: VoxelMap) -> Box:
    """The local horizon: a square of `edge_m` about the robot, over the map's full height."""
    lower = np.asarray(voxels.lower_m(), dtype=np.float64)
    top = lower[2] + voxels.states.shape[2] * voxels.config.size_m
    return Box(
        lower_m=np.array([xy_m[0] - edge_m / 2, xy_m[1] - edge_m / 2, lower[2]]),
        upper_m=np.array([xy_m[0] + edge_m / 2, xy_m[1] + edge_m / 2, top]),
    )
