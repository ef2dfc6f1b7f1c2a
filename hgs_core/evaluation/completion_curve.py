"""How complete a map is while it grows: the observable completion ratio over path length and time.

A full evaluation at every reading would take longer than the mission. Here a sample that was once closer than
5 cm to a centre stays complete, and of all others only those are measured that have a centre in a
neighbouring cell, against the centres in such cells alone: the answer is that of measuring everything.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from hgs_core.errors import CheckpointError
from hgs_core.evaluation.report_parts import CurvePoint
from hgs_core.evaluation.surface import COMPLETION_THRESHOLD_M

_MAX_CELLS: Final = 30_000_000
"""Of a reading's raster (a byte each); larger worlds get larger cells."""


class CompletionTracker:
    """Which of the observable samples some reading found complete."""

    def __init__(
        self, samples_m: Float[ndarray, "n 3"], *, threshold_m: float = COMPLETION_THRESHOLD_M
    ) -> None:
        """`samples_m` are the observable ones alone."""
        self._n_samples = len(samples_m)
        self._threshold_m = threshold_m
        self._raster = _Raster.around(samples_m, least_cell_m=2 * threshold_m)
        self._incomplete = np.arange(len(samples_m), dtype=np.int32)
        """Which samples no reading has found complete; their places and cells follow."""
        self._incomplete_m = np.asarray(samples_m, dtype=float)
        self._cells = self._raster.cells_of(self._incomplete_m)

    @property
    def ratio(self) -> float:
        """Share of the samples that were complete at some reading; 0 where there are none."""
        return 1.0 - len(self._incomplete_m) / self._n_samples if self._n_samples else 0.0

    def read(self, centres_m: Float[ndarray, "m 3"]) -> float:
        """Take in the map as it is, and return `ratio`."""
        wanted = self._raster.neighbourhood(self._cells)
        cells = self._raster.cells_of(centres_m)
        chosen = np.flatnonzero(wanted[cells])
        if len(chosen) == 0:
            return self.ratio
        near = np.flatnonzero(self._raster.neighbourhood(cells[chosen])[self._cells])
        tree = cKDTree(centres_m[chosen].astype(float), balanced_tree=False, compact_nodes=False)
        distances = tree.query(self._incomplete_m[near], distance_upper_bound=self._threshold_m)[0]
        kept = np.ones(len(self._incomplete_m), dtype=bool)
        kept[near[distances < self._threshold_m]] = False
        self._keep(kept)
        return self.ratio

    def state(self) -> dict[str, Any]:
        """What later readings depend on besides the samples."""
        return {"n_samples": self._n_samples, "incomplete": self._incomplete}

    def restore(self, state: dict[str, Any]) -> None:
        """For a tracker of the same samples that has read nothing. Raises `CheckpointError` for others."""
        if state["n_samples"] != self._n_samples:
            raise CheckpointError(
                f"the curve was recorded over {state['n_samples']} samples, the scene has {self._n_samples}"
            )
        kept = np.zeros(self._n_samples, dtype=bool)
        kept[state["incomplete"]] = True
        self._keep(kept)

    def _keep(self, kept: Bool[ndarray, " n_incomplete"]) -> None:
        self._incomplete = self._incomplete[kept]
        self._incomplete_m, self._cells = self._incomplete_m[kept], self._cells[kept]


class _Raster:
    """Cells over the samples' bounding box; what lies outside is in a border."""

    def __init__(self, lower_m: Float[ndarray, " 3"], cell_m: float, shape: tuple[int, ...]) -> None:
        self._lower_m = lower_m.astype(np.float32)
        self._cell_m = cell_m
        self._shape = shape

    @staticmethod
    def around(points_m: Float[ndarray, "n 3"], *, least_cell_m: float) -> _Raster:
        lower = points_m.min(axis=0) if len(points_m) else np.zeros(3)
        size = np.ptp(points_m, axis=0) if len(points_m) else np.zeros(3)
        cell = least_cell_m
        while np.prod(shape := np.ceil(size / cell).astype(int) + 5) > _MAX_CELLS:
            cell *= 1.25
        return _Raster(lower - 2 * cell, cell, tuple(int(n) for n in shape))

    def cells_of(self, points_m: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
        index = np.zeros(len(points_m), dtype=np.int32)
        for axis, n_cells in enumerate(self._shape):
            along = (points_m[:, axis].astype(np.float32) - self._lower_m[axis]) / np.float32(self._cell_m)
            index *= n_cells
            index += np.clip(along, 0, n_cells - 1).astype(np.int32)
        return index

    def neighbourhood(self, cells: Int[ndarray, " n"]) -> Bool[ndarray, " n_cells"]:
        """Whether each cell or one of its 26 neighbours is among `cells`; never of cells in the border."""
        occupied = np.zeros(self._shape, dtype=bool)
        occupied.ravel()[cells] = True
        for axis in range(3):
            before = np.moveaxis(occupied.copy(), axis, 0)
            grown = np.moveaxis(occupied, axis, 0)
            grown[1:] |= before[:-1]
            grown[:-1] |= before[1:]
            grown[[0, -1]] = False
        return occupied.ravel()


def path_m_at(curve: Sequence[CurvePoint], level: float) -> float | None:
    """Path length at which the curve first reaches `level`, between two readings linearly; None if never."""
    return _first_at([(point.path_m, point.ratio) for point in curve], level)


def time_s_at(curve: Sequence[CurvePoint], level: float) -> float | None:
    """Mission time likewise."""
    return _first_at([(point.time_s, point.ratio) for point in curve], level)


def _first_at(points: Sequence[tuple[float, float]], level: float) -> float | None:
    last_at, last_ratio = 0.0, 0.0
    for at, ratio in points:
        if ratio >= level:
            return last_at + (at - last_at) * (level - last_ratio) / (ratio - last_ratio)
        last_at, last_ratio = at, ratio
    return None
