"""Subspaces of the global level: even cuboids and their states (HGS-Planner section III-D).

A cuboid spans the full height of the map. It is *unreconstructed* while nothing in it has been observed,
*reconstructing* while enough is missing, and *reconstructed* when little is missing, or when what is missing
cannot be gained (*exhausted*: the reason is kept). Hysteresis, after TARE: a reconstructed cuboid reopens
only on clear evidence: its missing volume grew by `reopen_volume_m3` beyond the least since it was closed,
or, when it was exhausted, the robot can now stand in many more places near it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.boxes import Box
from hgs_core.planning.plan import Subspace, SubspaceState, UnseenReason
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

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
class MissingColumns:
    """Missing voxels summed over height: one entry a column that has any."""

    xy_m: Float[ndarray, "n 2"]
    volume_m3: Float[ndarray, " n"]
    keys: Int[ndarray, "n 2"]

    def of(self, key: Key) -> Int[ndarray, " k"]:
        """Indices of the columns in one cuboid."""
        return self._rows_by_key.get(key, np.zeros(0, np.int64))

    @cached_property
    def _rows_by_key(self) -> dict[Key, Int[ndarray, " k"]]:
        order = np.lexsort((self.keys[:, 1], self.keys[:, 0]))
        ordered = self.keys[order]
        starts = np.flatnonzero(np.any(np.diff(ordered, axis=0, prepend=ordered[:1] - 1) != 0, axis=1))
        rows = np.split(order, starts[1:]) if len(starts) else []
        return {(int(i), int(j)): of_key for (i, j), of_key in zip(ordered[starts], rows, strict=True)}


class SubspacePartition:
    """All cuboids that the voxel map has reached, keyed by their index on the floor plane."""

    def __init__(self, config: SubspaceConfig, *, origin_m: Float[ndarray, " 2"]) -> None:
        self.config = config
        self.origin_m = origin_m
        self.records: dict[Key, SubspaceRecord] = {}
        self._height_m = (0.0, 0.0)

    def update(self, voxels: VoxelMap) -> MissingColumns:
        """Bring all states up to the voxel map; returns where voxels are missing."""
        size = voxels.config.size_m
        lower = np.asarray(voxels.lower_m(), dtype=np.float64)
        self._height_m = (float(lower[2]), float(lower[2] + voxels.states.shape[2] * size))
        missing = voxels.missing_in_columns()
        nx, ny, nz = voxels.states.shape
        observed = voxels.count_in_columns((0, 0, 0), (nx, ny, nz))[..., VoxelState.UNOBSERVED] < nz
        column_x = self._index(lower[0] + (np.arange(nx) + 0.5) * size, 0)
        column_y = self._index(lower[1] + (np.arange(ny) + 0.5) * size, 1)
        first_x, first_y = int(column_x[0]), int(column_y[0])
        wide = int(column_y[-1]) - first_y + 1
        flat = ((column_x - first_x)[:, None] * wide + (column_y - first_y)[None, :]).ravel()
        n = (int(column_x[-1]) - first_x + 1) * wide
        volume = np.bincount(flat, weights=missing.ravel(), minlength=n) * size**3
        seen = np.bincount(flat, weights=observed.ravel(), minlength=n) > 0
        for index in range(n):
            key = (first_x + index // wide, first_y + index % wide)
            self._advance(key, float(volume[index]), bool(seen[index]))
        ij = np.argwhere(missing)
        return MissingColumns(
            xy_m=lower[:2] + (ij + 0.5) * size,
            volume_m3=missing[missing > 0] * size**3,
            keys=np.stack([column_x[ij[:, 0]], column_y[ij[:, 1]]], axis=1),
        )

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

    def _index(self, coordinate_m: Float[ndarray, " n"], axis: int) -> Int[ndarray, " n"]:
        return np.floor((coordinate_m - self.origin_m[axis]) / self.config.edge_m).astype(np.int64)

    def _advance(self, key: Key, missing_m3: float, seen: bool) -> None:
        record = self.records.setdefault(
            key, SubspaceRecord(state=SubspaceState.UNRECONSTRUCTED, missing_volume_m3=0.0)
        )
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


def horizon_around(xy_m: Float[ndarray, " 2"], edge_m: float, voxels: VoxelMap) -> Box:
    """The local horizon: a square of `edge_m` about the robot, over the map's full height."""
    lower = np.asarray(voxels.lower_m(), dtype=np.float64)
    top = lower[2] + voxels.states.shape[2] * voxels.config.size_m
    return Box(
        lower_m=np.array([xy_m[0] - edge_m / 2, xy_m[1] - edge_m / 2, lower[2]]),
        upper_m=np.array([xy_m[0] + edge_m / 2, xy_m[1] + edge_m / 2, top]),
    )
