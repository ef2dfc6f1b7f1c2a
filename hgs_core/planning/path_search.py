"""Shortest paths over the navigation grid, and their smoothing by line of sight.

Distances are costs in metres (a metre at full clearance costs 1). Paths are polylines in world metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, Int32
from numpy import ndarray

from hgs_core.native import kernels
from hgs_core.planning.navigation_grid import NavigationGrid

ENTRY_RADII_M = (0.3, 0.8, 1.6)
"""How far from the robot a cell may lie through which it enters the grid: the nearest ring that offers
one."""
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

    def cells_to(self, cell: int) -> Int[ndarray, " n"]:
        """Flat cells from the robot's entry to `cell`, which must be reachable."""
        parent = self.parent.ravel()
        cells = [cell]
        while parent[cells[-1]] != cells[-1]:
            cells.append(int(parent[cells[-1]]))
        return np.array(cells[::-1])


def reach_from(grid: NavigationGrid, robot_xy_m: Float[ndarray, " 2"]) -> ReachField:
    """One-to-all Dijkstra from the robot.

    The robot stands between cell centres: it enters through passable cells near it that it reaches in a
    straight line without coming nearer to anything than it is now, or than its radius. When it stands closer
    than its radius to something just seen, that is the shortest way out: any line that never comes nearer.
    """
    here = float(grid.path_clearance_m(robot_xy_m[None])[0])
    allowed = min(grid.radius_m, here) - 1e-6
    seeds: Int[ndarray, " n"] = np.zeros(0, np.int64)
    costs: Float[ndarray, " n"] = np.zeros(0)
    passable = np.flatnonzero(grid.passable.ravel())
    away = np.linalg.norm(grid.centres_m(passable) - robot_xy_m, axis=1)
    for radius in ENTRY_RADII_M:
        near = passable[away <= radius]
        clear, cost = grid.check_segments(np.tile(robot_xy_m, (len(near), 1)), grid.centres_m(near))
        seeds, costs = near[clear >= allowed], cost[clear >= allowed]
        if len(seeds):
            break
    distance, parent = kernels.grid_dijkstra(grid.cost, seeds.astype(np.int32), costs / grid.size_m)
    return ReachField(
        origin_m=robot_xy_m,
        distance_m=distance * grid.size_m,
        parent=parent,
        escaping=here < grid.radius_m - 1e-6,
    )


def path_from_robot(grid: NavigationGrid, reach: ReachField, cell: int) -> Float[ndarray, "n 2"]:
    """The smoothed way from the robot to a reachable cell."""
    points = np.concatenate([reach.origin_m[None], grid.centres_m(reach.cells_to(cell))])
    return smooth(grid, points)


def shortest_path(grid: NavigationGrid, start: int, goal: int) -> Float[ndarray, "n 2"] | None:
    """A* between two cells, smoothed; `None` where there is no way."""
    cells, _ = kernels.grid_astar(grid.cost, start, goal)
    return smooth(grid, grid.centres_m(cells)) if len(cells) else None


def pairwise_costs(grid: NavigationGrid, cells: Int[ndarray, " n"]) -> Float[ndarray, "n n"]:
    """Path costs [m] between every two cells; +inf where there is no way."""
    if not len(cells):
        return np.zeros((0, 0))
    return kernels.grid_pairwise(grid.cost, cells.astype(np.int32)) * grid.size_m


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
    return points[grid.straighten(points, SHORTCUT_COST_FACTOR)]
