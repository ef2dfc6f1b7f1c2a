"""The local level: HGS-Planner Algorithm 1 and the tour over the views that it selects.

Places are the global path's crossing of the horizon and samples at least 1.5 m apart. So that plans do not
flicker with the dice, the places still worth visiting from the plan before come first, then the robot's own
place (turning is cheap), then the views that the global level found inside the horizon; random samples fill
the gaps. When none of them is worth a visit although something in the horizon is missing, samples are drawn
again, densely, near what is missing.

The tour's costs are seconds: driving at the robot's speed along the grid's path, and turning in place, from
the heading at the start to the drive's and from there to the view's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.tours import open_tour
from hgs_core.planning.travel_times import TravelTimes
from hgs_core.planning.views import View
from hgs_core.robot.robot import RobotConfig


class LocalConfig(StrictConfig):
    horizon_m: float = Field(6.0, gt=0)
    """Edge of the square local horizon about the robot [m]."""
    sample_spacing_m: float = Field(1.5, gt=0)
    """Least distance between sampled places [m]."""
    dense_spacing_m: float = Field(0.6, gt=0)
    """Least distance when sampling again near what is missing [m]."""
    dense_radius_m: float = Field(3.0, gt=0)
    """How near to something missing a place of the second sampling lies [m]."""
    dense_samples: int = Field(40, ge=1)
    """At most so many places in the second sampling."""
    dense_missing_m3: float = Field(0.05, gt=0)
    """The second sampling needs this much missing inside the horizon [m^3]."""
    commitment_s: float = Field(1.5, ge=0)
    """The previous plan's next place costs so much less to go to first [s]: no dithering between equals."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalViews:
    """The local level's answer."""

    tour: list[View]
    """Selected views in the order of visit."""
    rejected: list[View]
    """Sampled views below the threshold."""
    crossing: View | None
    """The view at the crossing, if there is one: the tour leads to it whatever its gain."""


class LocalPlanner:
    """Selects and orders views inside the horizon. Keeps no state between cycles."""

    def __init__(self, config: LocalConfig, robot: RobotConfig, *, gain_threshold: float) -> None:
        self.config = config
        self._gain_threshold = gain_threshold
        self._travel = TravelTimes(robot)

    def select(
        self,
        cycle: PlanningCycle,
        rng: np.random.Generator,
        *,
        crossing_cell: int | None,
        carried_m: Float[ndarray, "n_carried 2"],
        suggested: list[View],
    ) -> LocalViews:
        """Algorithm 1. `carried_m` are the previous plan's places, its next one first."""
        here = cycle.place_near(cycle.robot_xy_m, 4.0 * cycle.grid.size_m)
        cells = self._sample(cycle, rng, carried_m, suggested)
        crossing_cells = np.array([] if crossing_cell is None else [crossing_cell], dtype=np.int64)
        places = np.concatenate(
            [cycle.grid.centres_m(crossing_cells), cycle.robot_xy_m[None], cycle.grid.centres_m(cells)]
        )
        at = [*crossing_cells.tolist(), -1 if here is None else here, *cells.tolist()]
        views = cycle.scorer.score(cycle.snapshot, places, at, cycle.observed_share)
        crossing = views.pop(0) if crossing_cell is not None else None
        selected = [view for view in views if view.total_gain >= self._gain_threshold]
        rejected = [view for view in views if view.total_gain < self._gain_threshold]
        if not selected:
            again = self._sample_densely(cycle, rng)
            selected = [view for view in again if view.total_gain >= self._gain_threshold]
            selected = self._spread(selected)
            rejected += [view for view in again if view.total_gain < self._gain_threshold]
        next_m = carried_m[0] if len(carried_m) else None
        return LocalViews(
            tour=self.order(cycle, selected, crossing, next_m), rejected=rejected, crossing=crossing
        )

    def _sample(
        self,
        cycle: PlanningCycle,
        rng: np.random.Generator,
        carried_m: Float[ndarray, "n_carried 2"],
        suggested: list[View],
    ) -> Int[ndarray, " n"]:
        """Carried, suggested and sampled places as cells."""
        wanted = [*carried_m, *(view.xy_m for view in suggested)]
        kept = cycle.places_apart(wanted, self.config.dense_spacing_m)
        places = cycle.places_in_horizon()
        sampled = poisson_disk(
            cycle.grid.centres_m(places),
            self.config.sample_spacing_m,
            rng,
            preferred=cycle.is_roomy(places),
            taken_m=cycle.taken_m(kept),
        )
        return np.concatenate([kept, places[sampled]])

    def _sample_densely(self, cycle: PlanningCycle, rng: np.random.Generator) -> list[View]:
        inside = cycle.in_horizon(cycle.missing.xy_m)
        if float(cycle.missing.volume_m3[inside].sum()) < self.config.dense_missing_m3:
            return []
        near = cycle.places_in_horizon()
        near_m = cycle.grid.centres_m(near)
        # Missing columns thinned to one in 0.5 m: distances to them need no more.
        columns = np.unique(np.round(cycle.missing.xy_m[inside] / 0.5), axis=0) * 0.5
        apart = np.linalg.norm(near_m[:, None] - columns[None], axis=2)
        wanted = np.any(apart <= self.config.dense_radius_m, axis=1)
        chosen = poisson_disk(
            near_m[wanted], self.config.dense_spacing_m, rng, limit=self.config.dense_samples
        )
        return cycle.score(near[wanted][chosen])

    def _spread(self, views: list[View]) -> list[View]:
        """The best of views closer to each other than the usual spacing."""
        kept: list[View] = []
        for view in sorted(views, key=lambda v: -v.total_gain):
            if all(np.hypot(*(view.xy_m - other.xy_m)) >= self.config.sample_spacing_m for other in kept):
                kept.append(view)
        return kept

    def order(
        self,
        cycle: PlanningCycle,
        selected: list[View],
        crossing: View | None,
        next_m: Float[ndarray, " 2"] | None,
    ) -> list[View]:
        """Open tour from the robot over the selected views, ending at the crossing if there is one."""
        if not selected:
            return []
        stops = [*selected, crossing] if crossing is not None else selected
        costs = self._travel.committed_times_s(cycle, stops, next_m, self.config.commitment_s)
        order = open_tour(costs, fixed_end=len(stops) if crossing is not None else None)
        return [stops[k - 1] for k in order[1:] if k <= len(selected)]
