"""The global level (HGS-Planner section III-D): a tour over the subspaces outside the horizon."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.executable_path import leg_between
from hgs_core.planning.path_search import GridWays, smooth, ways_between, without_straights
from hgs_core.planning.roadmap import Roadmap
from hgs_core.planning.subspace_views import OpenSubspaces, SubspaceViews, SubspaceViewsConfig
from hgs_core.planning.tours import open_tour
from hgs_core.planning.views import View


class GlobalConfig(SubspaceViewsConfig):
    detour_factor: float = Field(1.3, ge=1)
    """A roadmap route that costs more than this times the grid's way is replaced by the grid's."""


@dataclass(kw_only=True, eq=False)
class GlobalTour:
    """The tour from the robot over the views of the open subspaces."""

    open: OpenSubspaces
    goals: list[View] = field(default_factory=list)
    """In the order of visit."""
    legs_m: list[Float[ndarray, "n 2"]] = field(default_factory=list)
    """The way to each goal from the one before; the first from the robot. Only that one is smoothed: the
    others will be planned anew before they are driven."""
    grid_legs: int = 0
    """Legs for which the roadmap had no connection, or only a long way round: the grid's way was taken."""

    @property
    def polyline_m(self) -> Float[ndarray, "n 2"]:
        return np.concatenate(self.legs_m) if self.legs_m else np.zeros((0, 2))


class GlobalPlanner:
    """Orders the views of the open subspaces over the roadmap."""

    def __init__(self, config: GlobalConfig, *, views: SubspaceViews, roadmap: Roadmap) -> None:
        self.config = config
        self.views = views
        self.roadmap = roadmap

    def tour(self, cycle: PlanningCycle, rng: np.random.Generator, *, whole_map: bool) -> GlobalTour:
        """Tour the reconstructing subspaces; with `whole_map`, those inside the horizon, too."""
        tour = GlobalTour(open=self.views.update(cycle, rng, whole_map=whole_map))
        if tour.open.goals:
            self._order(cycle, tour)
        return tour

    def _order(self, cycle: PlanningCycle, tour: GlobalTour) -> None:
        """Sort the goals into an open tour and find its legs: the roadmap's, or the grid's where the roadmap
        has no connection or a long way round."""
        places = np.stack([cycle.robot_xy_m, *(view.xy_m for view in tour.open.goals)])
        cells = np.array([goal.cell for goal in tour.open.goals])
        routes = self.roadmap.routes(cycle.grid, places)
        ways = ways_between(cycle.grid, cells)
        by_grid = self._grid_costs(cycle, cells, ways)
        from_roadmap = routes.costs_m <= self.config.detour_factor * by_grid
        order = open_tour(np.where(from_roadmap, routes.costs_m, by_grid))
        goals = tour.open.goals
        for a, b in zip(order[:-1].tolist(), order[1:].tolist(), strict=True):
            tour.goals.append(goals[b - 1])
            route = routes.route(a, b) if from_roadmap[a, b] else None
            if route is not None:
                leg = route if a else smooth(cycle.grid, route)
            elif a and ways.costs_m[a - 1, b - 1] <= by_grid[a, b]:
                leg = without_straights(cycle.grid.centres_m(ways.cells_between(a - 1, b - 1)))
            else:
                leg = leg_between(cycle, goals[a - 1] if a else None, goals[b - 1])
            tour.legs_m.append(leg)
            tour.grid_legs += route is None

    @staticmethod
    def _grid_costs(
        cycle: PlanningCycle, cells: Int[ndarray, " n_goals"], ways: GridWays
    ) -> Float[ndarray, "n n"]:
        """Costs of the grid's ways between every two of the robot (row 0) and the goals."""
        by_grid = np.zeros((len(cells) + 1, len(cells) + 1))
        by_grid[0, 1:] = by_grid[1:, 0] = cycle.reach.distance_m.ravel()[cells]
        by_grid[1:, 1:] = ways.costs_m
        # Between two reachable places there is a way through the robot's, if entering its cells takes an
        # escape.
        return np.minimum(by_grid, by_grid[:, :1] + by_grid[:1, :])

    def state(self) -> dict[str, Any]:
        return {"roadmap": self.roadmap.state(), "views": self.views.state()}

    def restore(self, state: dict[str, Any]) -> None:
        self.roadmap.restore(state["roadmap"])
        self.views.restore(state["views"])
