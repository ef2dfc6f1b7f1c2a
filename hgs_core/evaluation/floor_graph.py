"""Shortest ways over the reachable floor between the places of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import gcd
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from hgs_core.evaluation.reachable import GRID_M, ReachableFloor

MAX_PLACES: Final = 4000
"""Places of a graph: all pairs of more take minutes and much memory."""
_REACH: Final = 3
"""Hops go up to so many grid steps along each axis: directions 13 degrees apart or less, so that ways are at
most 1.3 % longer than with any direction."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FloorGraph:
    """Places on the floor, and hops between neighbours whose straight line is free."""

    positions_m: Float[ndarray, "n 2"]
    hops_m: csr_array
    """(n, n): lengths of the hops, in both directions [m]."""

    @cached_property
    def _shortest(self) -> tuple[Float[ndarray, "n n"], Int[ndarray, "n n"]]:
        lengths, before = dijkstra(self.hops_m, return_predecessors=True)
        return lengths, before

    @property
    def lengths_m(self) -> Float[ndarray, "n n"]:
        """Length of the shortest way from each place to each."""
        return self._shortest[0]

    def way(self, begin: int, end: int) -> list[int]:
        """The places along the shortest way, both ends included."""
        before = self._shortest[1][begin]
        places = [end]
        while places[-1] != begin:
            places.append(int(before[places[-1]]))
        return places[::-1]

    def nearest(self, x_m: float, y_m: float) -> int:
        """The place nearest to a point, as the crow flies."""
        return int(np.argmin(np.hypot(*(self.positions_m - [x_m, y_m]).T)))


def floor_graph(floor: ReachableFloor, *, max_places: int = MAX_PLACES) -> FloorGraph:
    """The reachable multiples of 0.25 m; of 0.5 m, 0.75 m, ... where there would be more than `max_places`.

    Where the grid misses a passage that the floor's own raster leads through, the two sides are joined by a
    hop as long as the shortest way through the raster.
    """
    steps = 1
    while len(positions := floor.positions_m(steps * GRID_M)) > max_places:
        steps += 1
    grid = np.rint(positions / (steps * GRID_M)).astype(np.int64)
    rows, columns, lengths = [], [], []
    for offset in _offsets():
        begin, end = _pairs(grid, offset)
        free = _straight_is_free(floor, positions[begin], positions[end])
        rows.append(begin[free])
        columns.append(end[free])
        lengths.append(np.full(int(free.sum()), np.hypot(*offset) * steps * GRID_M))
    hops = _symmetric(np.concatenate(rows), np.concatenate(columns), np.concatenate(lengths), len(positions))
    return FloorGraph(positions_m=positions, hops_m=_joined(hops, floor, positions))


def _offsets() -> list[tuple[int, int]]:
    """One of each pair of opposite directions, none a multiple of another."""
    span = range(-_REACH, _REACH + 1)
    return [(i, j) for i in span for j in span if gcd(i, j) == 1 and (i, j) > (0, 0)]


def _pairs(
    grid: Int[ndarray, "n 2"], offset: tuple[int, int]
) -> tuple[Int[ndarray, " k"], Int[ndarray, " k"]]:
    """Indices of the places that have another at `offset`, and of those others."""
    lower, span = grid.min(axis=0) - _REACH, np.ptp(grid, axis=0) + 2 * _REACH + 1
    index = np.full(tuple(span), -1, np.int64)
    index[tuple((grid - lower).T)] = np.arange(len(grid))
    other = index[tuple((grid - lower + offset).T)]
    begin = np.flatnonzero(other >= 0)
    return begin, other[begin]


def _straight_is_free(
    floor: ReachableFloor, begin: Float[ndarray, "n 2"], end: Float[ndarray, "n 2"]
) -> Bool[ndarray, " n"]:
    """Whether every cell is reachable along straight lines, which all have one length, looked at twice a
    cell."""
    if len(begin) == 0:
        return np.zeros(0, dtype=bool)
    count = int(np.ceil(2 * np.hypot(*(end[0] - begin[0])) / floor.cell_m)) + 1
    share = np.linspace(0, 1, count)[:, None, None]
    cells = floor.index_of(begin + share * (end - begin))
    return np.all(floor.cells[cells[..., 0], cells[..., 1]], axis=0)


def _symmetric(
    rows: Int[ndarray, " k"], columns: Int[ndarray, " k"], lengths: Float[ndarray, " k"], n: int
) -> csr_array:
    both = (np.concatenate([rows, columns]), np.concatenate([columns, rows]))
    return csr_array(coo_array((np.concatenate([lengths, lengths]), both), shape=(n, n)))


def _joined(hops: csr_array, floor: ReachableFloor, positions: Float[ndarray, "n 2"]) -> csr_array:
    """The hops with the shortest ways through the raster that make them one connected graph."""
    n_parts, part = connected_components(hops, directed=False)
    if n_parts == 1:
        return hops
    raster, node_of = _raster_graph(floor)
    at = node_of[tuple(floor.index_of(positions).T)]
    while n_parts > 1:
        first = np.flatnonzero(part == part[0])
        ways, _, source = dijkstra(raster, indices=at[first], min_only=True, return_predecessors=True)
        others = np.flatnonzero(part != part[0])
        there = others[np.argmin(ways[at[others]])]
        here = first[np.flatnonzero(at[first] == source[at[there]])[0]]
        length = np.array([ways[at[there]]])
        hops = csr_array(hops + _symmetric(np.array([here]), np.array([there]), length, len(positions)))
        n_parts, part = connected_components(hops, directed=False)
    return hops


def _raster_graph(floor: ReachableFloor) -> tuple[csr_array, Int[ndarray, "n_x n_y"]]:
    """Neighbouring reachable cells (also across corners between two of them), and each cell's index."""
    index = np.full(np.array(floor.cells.shape) + 1, -1, np.int64)
    index[:-1, :-1][floor.cells] = np.arange(int(floor.cells.sum()))
    rows, columns, lengths = [], [], []
    here = index[:-1, :-1]
    right, up, across = index[1:, :-1], index[:-1, 1:], index[1:, 1:]
    diagonal = floor.cell_m * np.sqrt(2)
    corners = (right >= 0) & (up >= 0)
    for a, b, free, length in (
        (here, right, (here >= 0) & (right >= 0), floor.cell_m),
        (here, up, (here >= 0) & (up >= 0), floor.cell_m),
        (here, across, corners & (here >= 0) & (across >= 0), diagonal),
        (right, up, corners & (here >= 0) & (across >= 0), diagonal),
    ):
        rows.append(a[free])
        columns.append(b[free])
        lengths.append(np.full(int(free.sum()), length))
    graph = _symmetric(
        np.concatenate(rows), np.concatenate(columns), np.concatenate(lengths), int(floor.cells.sum())
    )
    return graph, here
