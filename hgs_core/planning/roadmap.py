"""A sparse random roadmap, grown along the travelled path (HGS-Planner section III-D, after TARE).

Nodes are never moved or dropped; every edge between near nodes is checked whenever the grid changed near it,
so an edge that became blocked is not used, and one that was blocked for want of observation comes into use
later.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, Int32
from numpy import ndarray
from pydantic import Field
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from hgs_core.config.base import StrictConfig
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import ReachField
from hgs_core.planning.sampling import poisson_disk


class RoadmapConfig(StrictConfig):
    node_spacing_m: float = Field(0.8, gt=0)
    """Least distance between nodes [m]."""
    edge_length_m: float = Field(1.8, gt=0)
    """Nodes closer than this are joined by an edge, where a straight line is clear [m]."""
    growth_radius_m: float = Field(4.0, gt=0)
    """New nodes are sampled in reachable cells this near to the robot [m]."""
    nodes_per_cycle: int = Field(30, ge=1)
    """At most so many new nodes a planning cycle."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RoadmapRoutes:
    """Shortest routes between `t` terminals over one state of the roadmap."""

    places_m: Float[ndarray, "n_all 2"]
    """The roadmap's nodes, then the terminals."""
    costs_m: Float[ndarray, "t t"]
    """Route costs; +inf where the roadmap has no connection."""
    _before: Int32[ndarray, "t n_all"]

    def route(self, start: int, goal: int) -> Float[ndarray, "k 2"] | None:
        """The polyline from one terminal to another, `None` without a connection."""
        if not np.isfinite(self.costs_m[start, goal]):
            return None
        first = len(self.places_m) - len(self.costs_m)
        route = [first + goal]
        while route[-1] != first + start:
            route.append(int(self._before[start, route[-1]]))
        return self.places_m[route[::-1]]


class Roadmap:
    """Nodes, edges, and shortest routes over them."""

    def __init__(self, config: RoadmapConfig) -> None:
        self.config = config
        self.nodes_m: Float[ndarray, "n 2"] = np.zeros((0, 2))
        self.edges: Int[ndarray, "m 2"] = np.zeros((0, 2), np.int64)
        self._usable: Bool[ndarray, " m"] = np.zeros(0, dtype=bool)
        self._costs: Float[ndarray, " m"] = np.zeros(0)
        self._checked_on: NavigationGrid | None = None
        """The grid that usability and costs of the edges hold for."""

    @property
    def usable_m(self) -> Float[ndarray, "m 2 2"]:
        """Both ends of every edge that can be driven, as far as has been checked."""
        return self.nodes_m[self.edges[: len(self._usable)][self._usable]]

    def grow(self, grid: NavigationGrid, reach: ReachField, rng: np.random.Generator) -> None:
        """Add the robot's place and random reachable places around it; check all edges against `grid`."""
        robot = reach.origin_m
        spacing = self.config.node_spacing_m
        places = [robot[None]] if self._nearest_m(robot) >= spacing else []
        near = grid.centres_m(grid.cells_within(reach.reachable, robot, self.config.growth_radius_m))
        taken = np.concatenate([self.nodes_m, *places])
        near_taken = taken[np.linalg.norm(taken - robot, axis=1) <= self.config.growth_radius_m + spacing]
        chosen = poisson_disk(near, spacing, rng, taken_m=near_taken, limit=self.config.nodes_per_cycle)
        self._add(np.concatenate([*places, near[chosen]]))
        self._check_edges(grid)

    def _nearest_m(self, place: Float[ndarray, " 2"]) -> float:
        return float(np.min(np.linalg.norm(self.nodes_m - place, axis=1))) if len(self.nodes_m) else np.inf

    def _add(self, places_m: Float[ndarray, "k 2"]) -> None:
        first = len(self.nodes_m)
        self.nodes_m = np.concatenate([self.nodes_m, places_m])
        new = np.arange(first, len(self.nodes_m))
        apart = np.linalg.norm(self.nodes_m[new][:, None] - self.nodes_m[None], axis=2)
        rows, columns = np.nonzero(
            (apart <= self.config.edge_length_m) & (np.arange(len(self.nodes_m)) < new[:, None])
        )
        self.edges = np.concatenate([self.edges, np.stack([new[rows], columns], axis=1)])

    def _check_edges(self, grid: NavigationGrid) -> None:
        """Bring usability and costs up to `grid`: of new edges, and of those where it has changed."""
        n_known = len(self._usable)
        starts, ends = self.nodes_m[self.edges[:, 0]], self.nodes_m[self.edges[:, 1]]
        stale = np.ones(len(self.edges), bool)
        if self._checked_on is not None:
            stale[:n_known] = grid.changed_along(self._checked_on, starts[:n_known], ends[:n_known])
        n_new = len(self.edges) - n_known
        self._usable = np.concatenate([self._usable, np.zeros(n_new, bool)])
        self._costs = np.concatenate([self._costs, np.zeros(n_new)])
        clear, self._costs[stale] = grid.check_segments(starts[stale], ends[stale])
        self._usable[stale] = clear >= grid.radius_m - 1e-6
        self._checked_on = grid

    def _joined(
        self, grid: NavigationGrid, terminals_m: Float[ndarray, "t 2"]
    ) -> tuple[Float[ndarray, "n_all 2"], Int[ndarray, "m 2"], Float[ndarray, " m"]]:
        """The usable graph with the terminals as further nodes, each joined to every near node in plain
        sight."""
        n = len(self.nodes_m)
        apart = np.linalg.norm(terminals_m[:, None] - self.nodes_m[None], axis=2)
        rows, columns = np.nonzero(apart <= self.config.edge_length_m)
        clear, cost = grid.check_segments(terminals_m[rows], self.nodes_m[columns])
        usable = clear >= grid.radius_m - 1e-6
        links = np.stack([n + rows[usable], columns[usable]], axis=1)
        edges = np.concatenate([self.edges[self._usable], links])
        return (
            np.concatenate([self.nodes_m, terminals_m]),
            edges,
            np.concatenate([self._costs[self._usable], cost[usable]]),
        )

    def routes(self, grid: NavigationGrid, terminals_m: Float[ndarray, "t 2"]) -> RoadmapRoutes:
        """The shortest routes between every two places."""
        places, edges, costs = self._joined(grid, terminals_m)
        graph = csr_array(
            (np.maximum(costs, 1e-9), (edges[:, 0], edges[:, 1])), shape=(len(places), len(places))
        )
        first = len(self.nodes_m)
        distances, before = dijkstra(
            graph, directed=False, indices=np.arange(first, len(places)), return_predecessors=True
        )
        return RoadmapRoutes(places_m=places, costs_m=distances[:, first:], _before=before)

    def state(self) -> dict[str, Any]:
        return {"nodes_m": self.nodes_m.copy(), "edges": self.edges.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        self.nodes_m = np.array(state["nodes_m"])
        self.edges = np.array(state["edges"])
        self._usable = np.zeros(0, dtype=bool)
        self._costs = np.zeros(0)
        self._checked_on = None
