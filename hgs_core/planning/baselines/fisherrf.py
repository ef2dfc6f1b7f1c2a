"""FisherRF's active mapping: frontiers propose goals, the Fisher information gathered on the way decides.

Jiang et al., "FisherRF: Active View Selection and Mapping with Radiance Fields Using Fisher Information",
ECCV 2024, section on active mapping.

Kept: candidate views stand around frontiers; the best of them by their own expected information gain,
`sum H_cand / (H_train + lambda)`, get a path each; along each path the gains of the views on it are
accumulated, and the path with the most wins. lambda is 0.1 (`gain.prior_information`). Without frontiers,
candidates are sampled over all free space, and the map is improved where it is least certain.

Not kept: the paper sums over a path however long it is, with a fixed number of steps to spend; here, where
length is what counts, the sum is divided by the length driven (`base_length_m` added, so that turning on the
spot is not free), and so is a goal's own gain when the best goals are picked. The paper drops random
Gaussians into unknown space, so that a view of it informs; here that is the coverage gain, in the same unit.
A view's gain on the way does not know of those before it on the same path: they lie `step_m` apart, and each
is cut to `share_of_goal` of the goal's own, so that no path is taken only because it is long. A mission ends
when nothing is worth a view; the paper counts steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.gain.registry import build_evaluator
from hgs_core.planning.baselines.candidates import places_near_missing
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.executable_path import leg_between
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.views import View


class FisherRfConfig(NextBestViewConfig):
    method: Literal["fisherrf"] = "fisherrf"
    frontier_m3: float = Field(0.1, gt=0)
    """A place is at a frontier when its best view newly covers this much [m^3]."""
    information_threshold: float = Field(0.3, gt=0)
    """Without frontiers, a view must gain this much (1 = the gain configuration's scales)."""
    view_radius_m: float = Field(4.0, gt=0)
    """Places farther than this from everything missing see no frontier [m]."""
    spacing_m: float = Field(0.8, gt=0)
    """Least distance between two candidates at frontiers [m]."""
    free_spacing_m: float = Field(1.2, gt=0)
    """Least distance between two candidates without frontiers [m]."""
    n_paths: int = Field(10, ge=1)
    """So many of the best candidates get a path."""
    step_m: float = Field(1.5, gt=0)
    """Views on the way are scored this far apart [m]."""
    share_of_goal: float = Field(0.2, ge=0)
    """A view on the way counts at most this share of the goal's gain."""
    base_length_m: float = Field(1.0, gt=0)
    """Added to a path's length before its gain is divided by it [m]: about what looking around once costs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """The path to a goal: where views on it are scored, and with which headings."""

    goal: View
    length_m: float
    points_m: Float[ndarray, "n 2"]
    headings_rad: Float[ndarray, " n"]


def information_per_metre(
    goal_gain: float,
    gains_on_way: Float[ndarray, " n"],
    length_m: float,
    *,
    share_of_goal: float,
    base_length_m: float,
) -> float:
    """What the views on a path gain together, over its length."""
    on_way = float(np.minimum(gains_on_way, share_of_goal * goal_gain).sum())
    return (goal_gain + on_way) / (length_m + base_length_m)


class FisherPaths:
    """The policy; it remembers nothing."""

    def __init__(self, config: FisherRfConfig) -> None:
        self._config = config

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        config = self._config
        near = places_near_missing(cycle, within_m=config.view_radius_m, spacing_m=config.spacing_m, rng=rng)
        views = cycle.score(near, coverage_only=True)
        at_frontier = np.array(
            [view.cell for view in views if _coverage(view) >= config.frontier_m3], np.int64
        )
        if len(at_frontier):
            candidates, kind = cycle.score(at_frontier), "frontier"
            rejected = [view for view in views if _coverage(view) < config.frontier_m3]
        else:
            everywhere = cycle.score(self._sampled(cycle, rng))
            candidates = [view for view in everywhere if view.total_gain >= config.information_threshold]
            rejected = [view for view in everywhere if view.total_gain < config.information_threshold]
            kind = "least certain part of the map"
        if not candidates:
            best = max((view.total_gain for view in rejected), default=0.0)
            return Choice(
                stops=[],
                rejected=rejected,
                reason=f"no frontier is left, and none of {len(rejected)} places gains "
                f"{config.information_threshold:.2f} of information, the best {best:.2f}",
            )
        ways = [self._way_to(cycle, goal) for goal in self._promising(cycle, candidates)]
        worth = self._worth(cycle, ways)
        chosen = ways[int(np.argmax(worth))]
        reason = (
            f"of {len(ways)} paths to a {kind}, the one that gathers most information a metre "
            f"({worth.max():.2f}), {chosen.length_m:.1f} m long"
        )
        others = [view for view in candidates if view is not chosen.goal]
        return Choice(stops=[chosen.goal], outranked=others, rejected=rejected, reason=reason)

    def state(self) -> dict[str, Any]:
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""

    def _promising(self, cycle: PlanningCycle, candidates: list[View]) -> list[View]:
        """Those with the most information of their own for their distance."""

        def per_metre(view: View) -> float:
            return view.total_gain / (cycle.distance_m(view.cell) + self._config.base_length_m)

        return sorted(candidates, key=per_metre, reverse=True)[: self._config.n_paths]

    def _sampled(self, cycle: PlanningCycle, rng: np.random.Generator) -> Int[ndarray, " n"]:
        places = np.flatnonzero(cycle.is_place)
        spread = poisson_disk(
            cycle.grid.centres_m(places), self._config.free_spacing_m, rng, preferred=cycle.is_roomy(places)
        )
        return places[spread]

    def _way_to(self, cycle: PlanningCycle, goal: View) -> Way:
        polyline = leg_between(cycle, None, goal)
        lengths = np.linalg.norm(np.diff(polyline, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(lengths)])
        at = np.arange(1, int(along[-1] / self._config.step_m)) * self._config.step_m
        points = np.column_stack([np.interp(at, along, polyline[:, axis]) for axis in range(2)])
        segments = np.clip(np.searchsorted(along, at, side="right") - 1, 0, max(len(lengths) - 1, 0))
        steps = np.diff(polyline, axis=0)
        headings = np.arctan2(steps[segments, 1], steps[segments, 0]) if len(at) else np.zeros(0)
        return Way(goal=goal, length_m=float(along[-1]), points_m=points, headings_rad=headings)

    def _worth(self, cycle: PlanningCycle, ways: list[Way]) -> Float[ndarray, " n_ways"]:
        """Paths share their beginnings: each cell on the way is scored once."""
        points = np.concatenate([way.points_m for way in ways])
        cells, _ = cycle.grid.cells_of(points)
        on_way, which = np.unique(cells, return_inverse=True)
        views = cycle.score(on_way)
        headings = np.concatenate([way.headings_rad for way in ways])
        gains = np.array(
            [views[k].gain_at(float(heading)) for k, heading in zip(which, headings, strict=True)]
        )
        ends = np.cumsum([len(way.points_m) for way in ways])
        return np.array(
            [
                information_per_metre(
                    way.goal.total_gain,
                    gains_on_way,
                    way.length_m,
                    share_of_goal=self._config.share_of_goal,
                    base_length_m=self._config.base_length_m,
                )
                for way, gains_on_way in zip(ways, np.split(gains, ends[:-1]), strict=True)
            ]
        )


def _coverage(view: View) -> float:
    """The coverage of its best yaw, believed as far as the memory does [m^3]."""
    undiscounted = view.undiscounted_gain_at(view.yaw_rad)
    return view.coverage_gain * view.total_gain / undiscounted if undiscounted > 0 else 0.0


def _build(config: FisherRfConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = build_evaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, FisherPaths(config))


METHOD = PlannerMethod(config=FisherRfConfig, build=_build)
