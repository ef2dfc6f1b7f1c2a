"""Shortest paths over the navigation grid, and their smoothing by line of sight.

Distances are costs in metres (a metre at full clearance costs 1). Paths are polylines in world metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Int, Int32
from numpy import ndarray
from scipy.spatial import cKDTree

from hgs_core.native import kernels
from hgs_core.planning.navigation_grid import NavigationGrid

ENTRY_RADII_M = (0.3, 0.8, 1.6)
"""How far from the robot a cell may lie through which it enters the grid: within the least of these that
leads out of a pocket."""
CORNER_M: Final = 0.005
"""A line out of a tight place may come so much nearer than the place is: past the corner of a box that stands
for something, its side is nearer by millimetres."""
POCKET_M2: Final = 2.0
"""Reaching no more than this, the robot may be in a pocket, and looks for lines out of it ..."""
BRIDGE_M: Final = 0.3
"""... between cells so near to each other [m]."""
_AROUND: Final = np.array([(i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0) if i or j])
SHORTCUT_COST_FACTOR = 1.03
"""A straight line may cost this much more than what it replaces: fewer turns are worth a little."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReachField:
    """All shortest paths from the robot."""

    origin_m: Float[ndarray, " 2"]
    distance_m: Float[ndarray, "nx ny"]
    """Cost of the way from the robot; +inf where there is none."""
    parent: Int32[ndarray, "nx ny"]
    """The flat cell before; its own for the cells where a path enters the grid; -1 unreached."""
    escaping: bool
    """The robot stands closer to something than its radius and has to leave first."""

    @property
    def reachable(self) -> Bool[ndarray, "nx ny"]:
        reachable: Bool[ndarray, "nx ny"] = np.isfinite(self.distance_m)
        return reachable

    def lengths_m(self, grid: NavigationGrid) -> Float[ndarray, " n_cells"]:
        """How long the way to each cell is, before it is smoothed; +inf where there is none."""
        parent = self.parent.ravel().astype(np.int64)
        reached = np.flatnonzero(parent >= 0)
        centres = grid.centres_m(np.arange(len(parent)))
        ahead = np.where(parent >= 0, parent, np.arange(len(parent)))
        length = np.linalg.norm(centres - centres[ahead], axis=1)
        while True:  # each round doubles how far back the lengths reach
            farther = ahead[ahead]
            if np.array_equal(farther, ahead):
                break
            length += length[ahead]
            ahead = farther
        total = np.full(len(parent), np.inf)
        entries = centres[ahead[reached]]
        total[reached] = length[reached] + np.linalg.norm(entries - self.origin_m, axis=1)
        return total

    def cells_to(self, cell: int) -> Int[ndarray, " n"]:
        """Flat cells from the robot's entry to `cell`, which must be reachable."""
        return _chain(self.parent.ravel(), cell)[::-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class GridWays:
    """Ways between every two of `n` places.

    One search from all places at once finds them: whatever the number of places, it goes over the grid once.
    The price is that the way between two places is the best one only as far as no third place is nearer to a
    part of it than both of them; otherwise it may lead by way of such a place.
    """

    costs_m: Float[ndarray, "n n"]
    """+inf where there is no way."""
    _next: Int32[ndarray, "n n"]
    """The place after the first on the way: they are neighbours."""
    _crossings: Int32[ndarray, "n n"]
    """The last flat cell, on the way between neighbours, that is nearest to the first of them."""
    _parent: Int32[ndarray, " n_cells"]
    """The flat cell before each cell, towards the place that it is nearest to."""

    def cells_between(self, start: int, goal: int) -> Int[ndarray, " k"]:
        """Flat cells of the way from one place to another; there must be one."""
        pieces = [np.zeros(0, np.int64)]
        while start != goal:
            after = int(self._next[start, goal])
            pieces.append(_chain(self._parent, int(self._crossings[start, after]))[::-1])
            pieces.append(_chain(self._parent, int(self._crossings[after, start])))
            start = after
        return np.concatenate(pieces)


def _chain(parent: Int32[ndarray, " n_cells"], cell: int) -> Int[ndarray, " n"]:
    """From a cell to the root of its tree, both included."""
    cells = [cell]
    while (before := int(parent[cells[-1]])) != cells[-1]:
        cells.append(before)
    return np.array(cells)


def reach_from(grid: NavigationGrid, robot_xy_m: Float[ndarray, " 2"]) -> ReachField:
    """One-to-all Dijkstra from the robot.

    The robot stands between cell centres: it enters through passable cells near it that it reaches in a
    straight line without coming nearer to anything than it is now, or than its radius. When it stands closer
    than its radius to something just seen, that is the shortest way out: any line that never comes nearer.
    Where such cells lead into a pocket alone, the robot came by another way: it looks farther for it.
    """
    seeds, costs = entries_within(grid, robot_xy_m, ENTRY_RADII_M[0])
    reach = reach_from_cells(grid, robot_xy_m, seeds, costs)
    for radius_m in ENTRY_RADII_M[1:]:
        if not _is_pocket(grid, reach.reachable):
            break
        farther, farther_costs = entries_within(grid, robot_xy_m, radius_m)
        beyond = ~reach.reachable.ravel()[farther]
        if beyond.any():
            seeds, costs = np.append(seeds, farther[beyond]), np.append(costs, farther_costs[beyond])
            reach = reach_from_cells(grid, robot_xy_m, seeds, costs)
    return reach


def reach_from_cells(
    grid: NavigationGrid,
    robot_xy_m: Float[ndarray, " 2"],
    seeds: Int[ndarray, " n"],
    costs: Float[ndarray, " n"],
) -> ReachField:
    """The same through given passable cells, which it takes so much to come to [m]."""
    here = float(grid.path_clearance_m(robot_xy_m[None])[0])
    distance, parent = _beyond_the_pocket(grid, seeds.astype(np.int32), costs / grid.size_m)
    return ReachField(
        origin_m=robot_xy_m,
        distance_m=distance * grid.size_m,
        parent=parent,
        escaping=here < grid.radius_m - 1e-6,
    )


def _beyond_the_pocket(
    grid: NavigationGrid, seeds: Int32[ndarray, " n"], costs: Float[ndarray, " n"]
) -> tuple[Float[ndarray, "nx ny"], Int32[ndarray, "nx ny"]]:
    """Dijkstra's distances [cells] and parents; out of a pocket also by straight lines between its cells and
    others near by that keep the radius clear.

    Steps from cell to cell need passable cells on both sides of a diagonal: between two corners one may be
    missing where a straight line just fits. The robot that came by such a line must get back.
    """
    distance, parent = kernels.grid_dijkstra(grid.cost, seeds, costs)
    came_from: dict[int, int] = {}
    while True:
        bridges = _bridges(grid, np.isfinite(distance))
        if not len(bridges):
            break
        starts, ends = bridges.T
        _, cost_m = grid.check_segments(grid.centres_m(starts), grid.centres_m(ends))
        arrival = distance.ravel()[starts] + cost_m / grid.size_m
        order = np.lexsort((starts, arrival, ends))
        first = order[np.diff(ends[order], prepend=-1) != 0]  # the cheapest to each end
        came_from |= dict(zip(ends[first].tolist(), starts[first].tolist(), strict=True))
        seeds, costs = np.append(seeds, ends[first].astype(np.int32)), np.append(costs, arrival[first])
        distance, parent = kernels.grid_dijkstra(grid.cost, seeds, costs)
    flat = parent.ravel()
    for cell, before in came_from.items():
        if flat[cell] == cell:
            flat[cell] = before
    return distance, flat.reshape(parent.shape)


def _is_pocket(grid: NavigationGrid, reached: Bool[ndarray, "nx ny"]) -> bool:
    return int(np.count_nonzero(reached)) * grid.size_m**2 <= POCKET_M2


def _bridges(grid: NavigationGrid, reached: Bool[ndarray, "nx ny"]) -> Int[ndarray, "n 2"]:
    """Pairs of flat cells, reached and not, that a short line joins; none where more than a pocket is
    reached."""
    none = np.zeros((0, 2), np.int64)
    outside = np.flatnonzero(grid.passable & ~reached)
    inside = np.flatnonzero(reached)
    if not len(inside) or not len(outside) or not _is_pocket(grid, reached):
        return none
    near = cKDTree(grid.centres_m(inside)).query_ball_point(grid.centres_m(outside), BRIDGE_M)
    counts = np.array([len(rows) for rows in near])
    starts = inside[np.concatenate([none[:, 0], *near]).astype(np.int64)]
    ends = np.repeat(outside, counts)
    clear, _ = grid.check_segments(grid.centres_m(starts), grid.centres_m(ends))
    return np.stack([starts, ends], axis=1)[clear >= grid.radius_m - 1e-6]


def entries_within(
    grid: NavigationGrid, xy_m: Float[ndarray, " 2"], radius_m: float
) -> tuple[Int[ndarray, " n"], Float[ndarray, " n"]]:
    """Passable cells (flat), so near, that a straight line joins to a point, and its cost [m]. The line comes
    no nearer to anything than the radius, or, from a point that is nearer already, hardly nearer than it."""
    here = float(grid.path_clearance_m(xy_m[None])[0])
    allowed = grid.radius_m - 1e-6 if here >= grid.radius_m - 1e-6 else here - CORNER_M
    near = grid.cells_within(grid.passable, xy_m, radius_m)
    clear, cost = grid.check_segments(np.tile(xy_m, (len(near), 1)), grid.centres_m(near))
    return near[clear >= allowed], cost[clear >= allowed]


def path_from_robot(grid: NavigationGrid, reach: ReachField, cell: int) -> Float[ndarray, "n 2"]:
    """The smoothed way from the robot to a reachable cell.

    The way out of a place that is too tight stays a leg of its own: a line from there is held against what it
    replaces, and would be allowed to be as tight all along.
    """
    centres = grid.centres_m(reach.cells_to(cell))
    if reach.escaping:
        return np.concatenate([reach.origin_m[None], smooth(grid, centres)])
    return smooth(grid, np.concatenate([reach.origin_m[None], centres]))


def shortest_path(grid: NavigationGrid, start: int, goal: int) -> Float[ndarray, "n 2"] | None:
    """A* between two cells, smoothed; `None` where there is no way."""
    cells, _ = kernels.grid_astar(grid.cost, start, goal)
    return smooth(grid, grid.centres_m(cells)) if len(cells) else None


def ways_between(grid: NavigationGrid, cells: Int[ndarray, " n"]) -> GridWays:
    """Ways between every two cells, by one search over the grid."""
    costs, after, crossings, parent = kernels.grid_ways(grid.cost, cells.astype(np.int32))
    return GridWays(costs_m=costs * grid.size_m, _next=after, _crossings=crossings, _parent=parent)


def pairwise_costs(grid: NavigationGrid, cells: Int[ndarray, " n"]) -> Float[ndarray, "n n"]:
    """Path costs [m] between every two cells; +inf where there is no way."""
    if not len(cells):
        return np.zeros((0, 0))
    return kernels.grid_pairwise(grid.cost, cells.astype(np.int32)) * grid.size_m


def without_straights(points_m: Float[ndarray, "n 2"]) -> Float[ndarray, "m 2"]:
    """A path over cells without the points at which it goes straight on."""
    steps = np.round(np.diff(points_m, axis=0), 6)
    turns = np.any(np.diff(steps, axis=0) != 0.0, axis=1)
    return points_m[np.concatenate([[True], turns, [True]])] if len(points_m) > 2 else points_m


def off_the_walls(grid: NavigationGrid, points_m: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """A path over cell centres, its tight points moved by half a cell to where there is most room.

    A centre may stand exactly its radius from a voxel's face, and what the voxel stands for may reach through
    that by a hair; in an aisle of an even number of cells there are 5 cm more towards the middle. Ends stay,
    and so does the whole path where any part of it would lose clearance.
    """
    inner = points_m[1:-1]
    clearance = grid.check_segments(inner, inner)[0]
    tight = np.flatnonzero(clearance < grid.radius_m + grid.margin_m)
    if not len(tight):
        return points_m
    tried = inner[tight, None] + 0.5 * grid.size_m * _AROUND
    ends = tried.reshape(-1, 2)
    room = grid.check_segments(ends, ends)[0].reshape(len(tight), len(_AROUND))
    best = np.argmax(room, axis=1)
    rows = np.arange(len(tight))
    better = room[rows, best] > clearance[tight] + 1e-3
    moved = points_m.copy()
    moved[1 + tight[better]] = tried[rows, best][better]
    before, after = grid.path_clearance_m(points_m), grid.path_clearance_m(moved)
    return moved if np.all(after >= np.minimum(before, grid.radius_m + grid.margin_m) - 1e-6) else points_m


def smooth(grid: NavigationGrid, points_m: Float[ndarray, "n 2"]) -> Float[ndarray, "m 2"]:
    """Replace runs of a path by straight lines, keeping its ends.

    A line replaces a run when it keeps the radius and margin clear (or at least what the run itself keeps,
    where the run is tighter) and costs hardly more: so it neither cuts corners nor gives up a preferred
    clearance.
    """
    moved = np.any(np.diff(points_m, axis=0) != 0.0, axis=1)
    points = points_m[np.concatenate([[True], moved])]
    if len(points) < 3:
        return points
    points = off_the_walls(grid, points)
    return points[grid.straighten(points, SHORTCUT_COST_FACTOR)]
