"""The global level: a tour over the reconstructing subspaces outside the horizon (HGS-Planner section III-D).

The paper joins the subspaces' centres. A centre is often inside furniture or a wall, so here each subspace is
represented by the best of a few reachable places near its missing voxels, scored like any view. This also
decides when a subspace is exhausted: when even a dense set of places near it gains less than the threshold.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.executable_path import leg_between
from hgs_core.planning.path_search import GridWays, smooth, ways_between, without_straights
from hgs_core.planning.plan import SubspaceState, UnseenReason
from hgs_core.planning.roadmap import Roadmap
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.subspaces import Key, MissingInCuboid, SubspacePartition
from hgs_core.planning.tours import open_tour
from hgs_core.planning.views import View


class GlobalConfig(StrictConfig):
    view_radius_m: float = Field(3.0, gt=0)
    """A subspace is first looked at from places this near to the middle of its missing voxels [m]."""
    view_spacing_m: float = Field(1.2, gt=0)
    """Least distance between these places [m]."""
    views_per_subspace: int = Field(6, ge=1)
    """At most so many places are scored at first."""
    dense_views_per_subspace: int = Field(20, ge=1)
    """Before a subspace is given up, so many places within the camera's range are scored."""
    stale_change: float = Field(0.2, gt=0, lt=1)
    """A subspace's view is scored again when its missing volume changed by more than this share."""
    max_goals: int = Field(32, ge=1)
    """The tour leads to the nearest so many subspaces; those beyond wait until it has come to them."""
    detour_factor: float = Field(1.3, ge=1)
    """A roadmap route that costs more than this times the grid's way is replaced by the grid's."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SubspaceView:
    """The best view of a subspace, and what it was chosen on."""

    view: View
    missing_volume_m3: float
    n_places: int


@dataclass(kw_only=True, eq=False)
class GlobalTour:
    """The tour from the robot over the subspaces' views."""

    keys: list[Key] = field(default_factory=list)
    goals: list[View] = field(default_factory=list)
    legs_m: list[Float[ndarray, "n 2"]] = field(default_factory=list)
    """The way to each goal from the one before; the first from the robot. Only that one is smoothed: the
    others will be planned anew before they are driven."""
    in_horizon: list[View] = field(default_factory=list)
    """Views of outside subspaces that lie inside the horizon: the local level visits them."""
    rejected: list[View] = field(default_factory=list)
    """Best views of subspaces that were exhausted in this cycle."""
    unreachable: list[Float[ndarray, " 2"]] = field(default_factory=list)
    """Middles of the missing voxels of subspaces that no reachable place can look at."""
    n_waiting: int = 0
    """Open subspaces that the tour does not lead to yet."""
    grid_legs: int = 0
    """Legs for which the roadmap had no connection, or only a long way round: the grid's way was taken."""

    @property
    def polyline_m(self) -> Float[ndarray, "n 2"]:
        return np.concatenate(self.legs_m) if self.legs_m else np.zeros((0, 2))


class GlobalPlanner:
    """Keeps the roadmap and the views of the subspaces."""

    def __init__(
        self,
        config: GlobalConfig,
        *,
        partition: SubspacePartition,
        roadmap: Roadmap,
        gain_threshold: float,
        camera_range_m: float,
    ) -> None:
        self.config = config
        self.partition = partition
        self.roadmap = roadmap
        self._gain_threshold = gain_threshold
        self._camera_range_m = camera_range_m
        self._views: dict[Key, SubspaceView] = {}

    def forget_views(self) -> None:
        """Score every subspace anew in the next tour."""
        self._views = {}

    def forget_view_at(self, place_m: Float[ndarray, " 2"]) -> None:
        """Score the subspace anew whose view is here: it has turned out to be worth less."""
        self._views = {key: known for key, known in self._views.items() if np.any(known.view.xy_m != place_m)}

    def tour(
        self, cycle: PlanningCycle, rng: np.random.Generator, *, whole_map: bool, ordered: bool
    ) -> GlobalTour:
        """Tour the reconstructing subspaces; with `whole_map`, those inside the horizon, too.

        Unless `ordered`, the goals come in no order and without legs.
        """
        tour = GlobalTour()
        columns = cycle.missing.xy_m
        everywhere = cycle.missing.gathered(np.ones(len(columns), bool))
        self._reconsider(cycle, everywhere)
        wanted = everywhere if whole_map else cycle.missing.gathered(~cycle.in_horizon(columns))
        open_keys = [
            key
            for key in self.partition.with_state(SubspaceState.RECONSTRUCTING)
            if key in wanted and wanted[key].volume_m3 >= self.partition.config.done_volume_m3
        ]
        counts = cycle.count_places_within(
            _stacked([wanted[key].middle_m for key in open_keys]), self.config.view_radius_m
        )
        stale = [
            key
            for key, n_places in zip(open_keys, counts.tolist(), strict=True)
            if not self._still_holds(key, wanted[key].volume_m3, n_places, cycle)
        ]
        self._represent({key: wanted[key] for key in stale}, cycle, rng, tour)
        for key in open_keys:
            if self.partition.records[key].state is SubspaceState.RECONSTRUCTING:
                self._accept(key, cycle, tour)
        for key in [
            key
            for key in self._views
            if self.partition.records[key].state is not SubspaceState.RECONSTRUCTING
        ]:
            del self._views[key]
        if tour.goals:
            self._keep_nearest(cycle, tour)
            if ordered:
                self._order(cycle, tour)
        return tour

    def _reconsider(self, cycle: PlanningCycle, missing: dict[Key, MissingInCuboid]) -> None:
        """Reopen exhausted subspaces that the robot can look at from clearly more places now."""
        keys = [
            key
            for key, record in self.partition.records.items()
            if record.exhausted is not None
            and record.missing_volume_m3 >= self.partition.config.done_volume_m3
        ]
        middles = _stacked([missing[key].middle_m for key in keys])
        counts = cycle.count_places_within(middles, self._camera_range_m)
        for key, n_places in zip(keys, counts.tolist(), strict=True):
            self.partition.reconsider(key, places=n_places)

    def _represent(
        self,
        missing: dict[Key, MissingInCuboid],
        cycle: PlanningCycle,
        rng: np.random.Generator,
        tour: GlobalTour,
    ) -> None:
        """Choose the views of some subspaces, or give them up: all are scored together, then, more densely,
        those for which nothing was found."""
        config, range_m = self.config, self._camera_range_m
        near = [cycle.places_within(of_key.middle_m, config.view_radius_m) for of_key in missing.values()]
        found = dict(
            zip(
                missing,
                self._best(near, config.view_spacing_m, config.views_per_subspace, cycle, rng),
                strict=True,
            )
        )
        weak = [key for key, view in found.items() if not self._is_worth_a_stop(view)]
        wide = [cycle.places_within(missing[key].middle_m, range_m) for key in weak]
        denser = self._best(wide, config.view_spacing_m / 2, config.dense_views_per_subspace, cycle, rng)
        for key, again, places in zip(weak, denser, wide, strict=True):
            views = [view for view in (found[key], again) if view is not None]
            found[key] = view = max(views, key=lambda v: v.total_gain, default=None)
            if self._is_worth_a_stop(view):
                continue
            reason = UnseenReason.UNREACHABLE if view is None else UnseenReason.BELOW_THRESHOLD
            self.partition.exhaust(key, reason, places=len(places))
            if view is None:
                tour.unreachable.append(missing[key].middle_m)
            else:
                tour.rejected.append(view)
        for (key, of_key), places in zip(missing.items(), near, strict=True):
            view = found[key]
            if view is not None and self._is_worth_a_stop(view):
                self._views[key] = SubspaceView(
                    view=view, missing_volume_m3=of_key.volume_m3, n_places=len(places)
                )

    def _is_worth_a_stop(self, view: View | None) -> bool:
        return view is not None and view.total_gain >= self._gain_threshold

    def _still_holds(self, key: Key, volume_m3: float, n_places: int, cycle: PlanningCycle) -> bool:
        """Whether a subspace's view was chosen on much the same, and can still be taken."""
        known, change = self._views.get(key), self.config.stale_change
        return (
            known is not None
            and abs(volume_m3 - known.missing_volume_m3) <= change * known.missing_volume_m3
            and abs(n_places - known.n_places) <= max(change * known.n_places, 20)
            and cycle.place_near(known.view.xy_m, cycle.grid.size_m) is not None
        )

    @staticmethod
    def _best(
        candidates: list[Int[ndarray, " _"]],
        spacing_m: float,
        limit: int,
        cycle: PlanningCycle,
        rng: np.random.Generator,
    ) -> list[View | None]:
        """The best view from some of the candidate places (flat cells), for each list of them.

        A subspace is open for what is missing in it: its place is chosen by coverage, and only the views from
        the chosen ones are scored for quality, too.
        """
        chosen = [
            cells[
                poisson_disk(
                    cycle.grid.centres_m(cells), spacing_m, rng, preferred=cycle.is_roomy(cells), limit=limit
                )
            ]
            for cells in candidates
        ]
        views = iter(cycle.score(np.concatenate([np.zeros(0, np.int64), *chosen]), coverage_only=True))
        best = [
            max(itertools.islice(views, len(cells)), key=lambda view: view.total_gain, default=None)
            for cells in chosen
        ]
        found = iter(cycle.score(np.array([view.cell for view in best if view is not None], np.int64)))
        return [None if view is None else next(found) for view in best]

    def _accept(self, key: Key, cycle: PlanningCycle, tour: GlobalTour) -> None:
        """Make a subspace's view a goal, or leave it to the local level."""
        view = self._views[key].view
        cell = cycle.place_near(view.xy_m, cycle.grid.size_m)
        assert cell is not None  # it was chosen now, or still holds
        view = view.at_cell(cell)
        if bool(cycle.in_horizon(view.xy_m[None])[0]):
            tour.in_horizon.append(view)
        else:
            tour.keys.append(key)
            tour.goals.append(view)

    def _order(self, cycle: PlanningCycle, tour: GlobalTour) -> None:
        """Sort the goals into an open tour and find its legs: the roadmap's, or the grid's where the roadmap
        has no connection or a long way round."""
        places = np.stack([cycle.robot_xy_m, *(view.xy_m for view in tour.goals)])
        cells = np.array([goal.cell for goal in tour.goals])
        routes = self.roadmap.routes(cycle.grid, places)
        ways = ways_between(cycle.grid, cells)
        by_grid = self._grid_costs(cycle, cells, ways)
        from_roadmap = routes.costs_m <= self.config.detour_factor * by_grid
        order = open_tour(np.where(from_roadmap, routes.costs_m, by_grid))
        goals, keys = tour.goals, tour.keys
        tour.goals, tour.keys = [], []
        for a, b in zip(order[:-1].tolist(), order[1:].tolist(), strict=True):
            tour.goals.append(goals[b - 1])
            tour.keys.append(keys[b - 1])
            route = routes.route(a, b) if from_roadmap[a, b] else None
            if route is not None:
                leg = route if a else smooth(cycle.grid, route)
            elif a and ways.costs_m[a - 1, b - 1] <= by_grid[a, b]:
                leg = without_straights(cycle.grid.centres_m(ways.cells_between(a - 1, b - 1)))
            else:
                leg = leg_between(cycle, goals[a - 1] if a else None, goals[b - 1])
            tour.legs_m.append(leg)
            tour.grid_legs += route is None

    def _keep_nearest(self, cycle: PlanningCycle, tour: GlobalTour) -> None:
        """A building has more open subspaces than a tour must know: where it goes first hardly depends on
        the far ones, and what they cost grows with their number squared."""
        distance_m = cycle.reach.distance_m.ravel()[[goal.cell for goal in tour.goals]]
        kept = np.sort(np.argsort(distance_m, kind="stable")[: self.config.max_goals]).tolist()
        tour.n_waiting = len(tour.goals) - len(kept)
        tour.goals = [tour.goals[k] for k in kept]
        tour.keys = [tour.keys[k] for k in kept]

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
        views = [
            {
                "key": list(key),
                "view": known.view.state(),
                "missing_volume_m3": known.missing_volume_m3,
                "n_places": known.n_places,
            }
            for key, known in self._views.items()
        ]
        return {"roadmap": self.roadmap.state(), "views": views}

    def restore(self, state: dict[str, Any]) -> None:
        self.roadmap.restore(state["roadmap"])
        self._views = {
            (int(entry["key"][0]), int(entry["key"][1])): SubspaceView(
                view=View.restore(entry["view"]),
                missing_volume_m3=float(entry["missing_volume_m3"]),
                n_places=int(entry["n_places"]),
            )
            for entry in state["views"]
        }


def _stacked(points_m: list[Float[ndarray, " 2"]]) -> Float[ndarray, "n 2"]:
    return np.array(points_m).reshape(-1, 2)
