"""The open subspaces of the global level, each represented by the best view of what is missing in it.

The paper joins the subspaces' centres. A centre is often inside furniture or a wall, so here each subspace is
represented by the best of a few reachable places near its missing voxels, scored like any view. This also
decides when a subspace is exhausted: when even a dense set of places near it gains less than the threshold.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.plan import SubspaceState, UnseenReason
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.subspaces import Key, MissingInCuboid
from hgs_core.planning.views import View

_SAME_PLACE_M: Final = 0.02
"""The pieces of a car's way add up to its goal only nearly."""


class SubspaceViewsConfig(StrictConfig):
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


@dataclass(frozen=True, kw_only=True, eq=False)
class SubspaceView:
    """The best view of a subspace, and what it was chosen on."""

    view: View
    missing_volume_m3: float
    n_places: int


@dataclass(kw_only=True, eq=False)
class OpenSubspaces:
    """What one cycle knows of the open subspaces."""

    goals: list[View] = field(default_factory=list)
    """The best view of each that is to be visited."""
    in_horizon: list[View] = field(default_factory=list)
    """Views that lie inside the horizon."""
    rejected: list[View] = field(default_factory=list)
    """Best views of subspaces that were exhausted in this cycle."""
    unreachable: list[Float[ndarray, " 2"]] = field(default_factory=list)
    """Middles of the missing voxels of subspaces that no reachable place can look at."""
    n_waiting: int = 0
    """Open subspaces beyond the nearest `max_goals`."""


class SubspaceViews:
    """Keeps the best view of each open subspace as long as it holds."""

    def __init__(
        self,
        config: SubspaceViewsConfig,
        *,
        gain_threshold: float,
        camera_range_m: float,
    ) -> None:
        self.config = config
        self.gain_threshold = gain_threshold
        """The total gain that a view must have; may change."""
        self._camera_range_m = camera_range_m
        self._views: dict[Key, SubspaceView] = {}

    def forget(self) -> None:
        """Score every subspace anew in the next cycle."""
        self._views = {}

    def forget_at(self, place_m: Float[ndarray, " 2"]) -> None:
        """Score the subspace anew whose view is here: it has turned out to be worth less."""
        self._views = {
            key: known
            for key, known in self._views.items()
            if np.hypot(*(known.view.xy_m - place_m)) > _SAME_PLACE_M
        }

    def update(self, cycle: PlanningCycle, rng: np.random.Generator, *, whole_map: bool) -> OpenSubspaces:
        """The subspaces that are open now; with `whole_map`, also for what is missing inside the horizon."""
        found = OpenSubspaces()
        columns = cycle.missing.xy_m
        everywhere = cycle.missing.gathered(np.ones(len(columns), bool))
        self._reconsider(cycle, everywhere)
        wanted = everywhere if whole_map else cycle.missing.gathered(~cycle.in_horizon(columns))
        open_keys = [
            key
            for key in cycle.partition.with_state(SubspaceState.RECONSTRUCTING)
            if key in wanted and wanted[key].volume_m3 >= cycle.partition.config.done_volume_m3
        ]
        counts = cycle.count_places_within(
            _stacked([wanted[key].middle_m for key in open_keys]), self.config.view_radius_m
        )
        stale = [
            key
            for key, n_places in zip(open_keys, counts.tolist(), strict=True)
            if not self._still_holds(key, wanted[key].volume_m3, n_places, cycle)
        ]
        self._represent({key: wanted[key] for key in stale}, cycle, rng, found)
        for key in open_keys:
            if cycle.partition.records[key].state is SubspaceState.RECONSTRUCTING:
                self._accept(key, cycle, found)
        for key in [
            key
            for key in self._views
            if cycle.partition.records[key].state is not SubspaceState.RECONSTRUCTING
        ]:
            del self._views[key]
        self._keep_nearest(cycle, found)
        return found

    def _reconsider(self, cycle: PlanningCycle, missing: dict[Key, MissingInCuboid]) -> None:
        """Reopen exhausted subspaces that the robot can look at from clearly more places now."""
        keys = [
            key
            for key, record in cycle.partition.records.items()
            if record.exhausted is not None
            and record.missing_volume_m3 >= cycle.partition.config.done_volume_m3
        ]
        middles = _stacked([missing[key].middle_m for key in keys])
        counts = cycle.count_places_within(middles, self._camera_range_m)
        for key, n_places in zip(keys, counts.tolist(), strict=True):
            cycle.partition.reconsider(key, places=n_places)

    def _represent(
        self,
        missing: dict[Key, MissingInCuboid],
        cycle: PlanningCycle,
        rng: np.random.Generator,
        into: OpenSubspaces,
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
            cycle.partition.exhaust(key, reason, places=len(places))
            if view is None:
                into.unreachable.append(missing[key].middle_m)
            else:
                into.rejected.append(view)
        for (key, of_key), places in zip(missing.items(), near, strict=True):
            view = found[key]
            if view is not None and self._is_worth_a_stop(view):
                self._views[key] = SubspaceView(
                    view=view, missing_volume_m3=of_key.volume_m3, n_places=len(places)
                )

    def _is_worth_a_stop(self, view: View | None) -> bool:
        return view is not None and view.total_gain >= self.gain_threshold

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

    def _accept(self, key: Key, cycle: PlanningCycle, into: OpenSubspaces) -> None:
        """Make a subspace's view a goal, or leave it to the local level."""
        view = self._views[key].view
        cell = cycle.place_near(view.xy_m, cycle.grid.size_m)
        assert cell is not None  # it was chosen now, or still holds
        view = view.at_cell(cell)
        if bool(cycle.in_horizon(view.xy_m[None])[0]):
            into.in_horizon.append(view)
        else:
            into.goals.append(view)

    def _keep_nearest(self, cycle: PlanningCycle, found: OpenSubspaces) -> None:
        """A building has more open subspaces than a plan must know: where it goes first hardly depends on
        the far ones, and what they cost grows with their number squared."""
        distance_m = cycle.reach.distance_m.ravel()[[goal.cell for goal in found.goals]]
        kept = np.sort(np.argsort(distance_m, kind="stable")[: self.config.max_goals]).tolist()
        found.n_waiting = len(found.goals) - len(kept)
        found.goals = [found.goals[k] for k in kept]

    def state(self) -> list[dict[str, Any]]:
        return [
            {
                "key": list(key),
                "view": known.view.state(),
                "missing_volume_m3": known.missing_volume_m3,
                "n_places": known.n_places,
            }
            for key, known in self._views.items()
        ]

    def restore(self, state: list[dict[str, Any]]) -> None:
        self._views = {
            (int(entry["key"][0]), int(entry["key"][1])): SubspaceView(
                view=View.restore(entry["view"]),
                missing_volume_m3=float(entry["missing_volume_m3"]),
                n_places=int(entry["n_places"]),
            )
            for entry in state
        }


def _stacked(points_m: list[Float[ndarray, " 2"]]) -> Float[ndarray, "n 2"]:
    return np.array(points_m).reshape(-1, 2)
