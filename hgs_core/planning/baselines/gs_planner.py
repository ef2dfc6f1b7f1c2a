"""GS-Planner: greedy next best view among a few random samples, with a library of views left for later.

Jin et al., "GS-Planner: A Gaussian-Splatting-based Planning Framework for Active High-Fidelity
Reconstruction", arXiv 2405.10142.

Kept of the original:
- a view's gain is the unobserved volume that it sees through the splats and the reconstruction loss of what
  it sees, both at full weight whatever is known so far;
- viewpoints are sampled at random around the robot, at most 10 are scored a step, and the one with the
  greatest utility is next: its gain, less the farther the way to it (here by the exponential that
  next-best-view planners use since Bircher et al., ICRA 2016);
- a library of views: those that were worth a visit and not chosen. Here the robot turns to it when nothing
  sampled is worth a visit. No order of visits is planned: this is what makes the greedy robot come back.

Not kept:
- the loss is that of the newest image against the rendered one, cached in the voxels that the image shows.
  A planner sees the maps alone, no image; the quality gain (HGS-Planner Eq. 9) stands in for it: it, too, is
  the map's own estimate of where its pictures are wrong, and is large where little was learnt;
- its quadrotor's trajectories; paths are the grid's, as for all planners here.

Added: it ends by itself. When samples and library are exhausted, places all over the map are scored, ten at
once, until one is worth a visit; when none is, nothing is left.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field

from hgs_core.gain.registry import build_evaluator
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.views import View


class GSPlannerConfig(NextBestViewConfig):
    method: Literal["gs-planner"] = "gs-planner"
    gain_threshold: float = Field(0.5, gt=0)
    """A view is worth a visit when it gains this much (1 = the gain configuration's scales)."""
    path_discount_per_m: float = Field(0.25, ge=0)
    """The utility is `gain exp(-this * path)`, path in metres at full clearance [1/m]."""
    views_per_step: int = Field(10, ge=1)
    """At most so many views are scored at once."""
    sample_radius_m: float = Field(3.0, gt=0)
    """Viewpoints are sampled this near to the robot [m]."""
    sample_spacing_m: float = Field(0.8, gt=0)
    """Least distance between two samples, and between two views of the library [m]."""
    sweep_spacing_m: float = Field(1.0, gt=0)
    """Least distance between the places that are scored before the mission ends [m]."""


class GSPlanner:
    """The policy. Its library holds places and the gains that they had when they were scored."""

    def __init__(self, config: GSPlannerConfig) -> None:
        self._config = config
        self._library: Float[ndarray, "n 3"] = np.zeros((0, 3))
        """x [m], y [m] and gain of each view left for later."""

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        rejected: list[View] = []
        worth, source = self._sampled(cycle, rng, rejected), "sampled nearby"
        if not worth:
            worth, source = self._revisited(cycle, rejected), "left for later"
        if not worth:
            worth, source = self._swept(cycle, rng, rejected), "found all over the map"
        if not worth:
            gain = max((view.total_gain for view in rejected), default=0.0)
            why = f"no view anywhere gains {self._config.gain_threshold:.2f}, the best {gain:.2f}"
            return Choice(stops=[], rejected=rejected, reason=why)
        best = max(worth, key=lambda view: self._utility(cycle, view))
        others = [view for view in worth if view is not best]
        self._leave_for_later(others, taken=best)
        reason = f"the best of {len(worth)} views {source} (gain {best.total_gain:.2f})"
        return Choice(stops=[best], outranked=others, rejected=rejected, reason=reason)

    def state(self) -> dict[str, Any]:
        return {"library": self._library.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        self._library = np.array(state["library"])

    def _sampled(self, cycle: PlanningCycle, rng: np.random.Generator, rejected: list[View]) -> list[View]:
        """The robot's own place and random ones around it."""
        config, here = self._config, cycle.robot_xy_m
        near = cycle.places_within(here, config.sample_radius_m)
        chosen = poisson_disk(
            cycle.grid.centres_m(near),
            config.sample_spacing_m,
            rng,
            taken_m=here[None],
            limit=config.views_per_step - 1,
        )
        return self._worth_a_visit([*cycle.score_here(), *cycle.score(near[chosen])], rejected)

    def _revisited(self, cycle: PlanningCycle, rejected: list[View]) -> list[View]:
        """Views of the library, the most useful first, scored anew until one is still worth a visit; those
        that are not leave it."""
        while len(self._library):
            cells = [cycle.place_near(place, 2.0 * cycle.grid.size_m) for place in self._library[:, :2]]
            self._library = self._library[[cell is not None for cell in cells]]
            places = np.array([cell for cell in cells if cell is not None], np.int64)
            away = cycle.reach.distance_m.ravel()[places]
            order = np.argsort(-self._discounted(self._library[:, 2], away), kind="stable")
            now, later = np.split(order, [self._config.views_per_step])
            self._library = self._library[later]
            worth = self._worth_a_visit(cycle.score(places[now]), rejected)
            if worth:
                return worth
        return []

    def _swept(self, cycle: PlanningCycle, rng: np.random.Generator, rejected: list[View]) -> list[View]:
        """Places all over the map, the nearest first."""
        places = np.flatnonzero(cycle.is_place)
        places = places[poisson_disk(cycle.grid.centres_m(places), self._config.sweep_spacing_m, rng)]
        places = places[np.argsort(cycle.reach.distance_m.ravel()[places], kind="stable")]
        for first in range(0, len(places), self._config.views_per_step):
            views = cycle.score(places[first : first + self._config.views_per_step])
            worth = self._worth_a_visit(views, rejected)
            if worth:
                return worth
        return []

    def _worth_a_visit(self, views: list[View], rejected: list[View]) -> list[View]:
        threshold = self._config.gain_threshold
        rejected += [view for view in views if view.total_gain < threshold]
        return [view for view in views if view.total_gain >= threshold]

    def _utility(self, cycle: PlanningCycle, view: View) -> float:
        at_robot = bool(np.all(view.xy_m == cycle.robot_xy_m))
        away = np.array([0.0 if at_robot else cycle.distance_m(view.cell)])
        return float(self._discounted(np.array([view.total_gain]), away)[0])

    def _discounted(self, gains: Float[ndarray, " n"], away_m: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        discounted: Float[ndarray, " n"] = gains * np.exp(-self._config.path_discount_per_m * away_m)
        return discounted

    def _leave_for_later(self, views: list[View], *, taken: View) -> None:
        """Put views in the library; each makes room for itself there, and so does the one that is taken."""
        for view in [taken, *views]:
            apart = np.linalg.norm(self._library[:, :2] - view.xy_m, axis=1)
            self._library = self._library[apart >= self._config.sample_spacing_m]
            if view is not taken:
                row = np.array([[*view.xy_m, view.total_gain]])
                self._library = np.concatenate([self._library, row])


def _build(config: GSPlannerConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = build_evaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, GSPlanner(config))


METHOD = PlannerMethod(config=GSPlannerConfig, build=_build)
