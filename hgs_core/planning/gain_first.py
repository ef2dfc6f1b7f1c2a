"""All views that are worth a stop, near and far, in the order that brings gains early on a short path.

Beyond HGS-Planner, by measurement:
- one order for near and far. A local tour that must be finished before the robot goes on cleans up nearby
  while most of the building is unknown (`least_latency_order` weighs both);
- many places. Half a metre decides whether a niche or a corner of a room is in sight: near the robot places
  are scored everywhere, tight corners included, and subspaces inside the horizon keep a view of their own;
- metres count. Turning in place makes no path, so it costs a fraction of its time;
- what many places show is counted once: of views that overlap few are kept, each with what it alone adds
  (`distinct_views`);
- gains are those of the newest maps, those of far subspaces, too. What is left of a view's gain is looked at
  while driving to it, and a view that was seen on the way is dropped.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field

from hgs_core.gain.registry import build_evaluator
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.latency import least_latency_order
from hgs_core.planning.next_best_view import Choice, NextBestViewConfig, NextBestViewPlanner
from hgs_core.planning.overlap import Overlap, distinct_views
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.sampling import poisson_disk
from hgs_core.planning.subspace_views import OpenSubspaces, SubspaceViews, SubspaceViewsConfig
from hgs_core.planning.survey import PlannerContext
from hgs_core.planning.travel_times import TravelTimes
from hgs_core.planning.views import View

_SAME_PLACE_M = 0.1


class GainFirstConfig(NextBestViewConfig):
    method: Literal["gain-first"] = "gain-first"
    gain_threshold: float = Field(0.5, gt=0)
    """The total gain (1 = the gain configuration's scales) that a stop must be worth ..."""
    glance_threshold: float = Field(0.1, gt=0)
    """... but this is enough where the robot stands, and between the two in proportion ..."""
    full_price_m: float = Field(3.0, gt=0)
    """... up to so long a way to it [m]."""
    last_share: float = Field(1.0, gt=0, le=1)
    """Once nothing gains that, so much of it is enough, until the end: corners come last."""
    abandon_share: float = Field(0.5, gt=0, le=1)
    """A view on the way is given up when its gain fell below this share of what a stop must be worth, and
    looked at anew, with all others, when it fell below this share of what was expected."""
    urgent_gain: float = Field(5.0, gt=0)
    """A view that gains this much leads to as much again: behind what is seen through a door is a room,
    behind a corner nothing. The mean time until gains come counts as much as the whole way's when the best
    view gains this much: more while rooms are unknown, less when corners are left."""
    turning_weight: float = Field(0.2, ge=0)
    """A second of turning in place counts as so much of a second of driving."""
    patience_m: float = Field(1.0, gt=0)
    """Of views that show the same, one that shows twice as much may be so much more than twice as far
    away [m]."""
    commitment_s: float = Field(1.5, ge=0)
    """The previous plan's next place costs so much less to go to first [s]: no dithering between equals."""
    sample_spacing_m: float = Field(0.5, gt=0)
    """Least distance between sampled places inside the horizon [m]."""
    quality_spacing_m: float = Field(1.5, gt=0)
    """Of these, places at least so far apart are scored for quality, too: it changes little from one to the
    next and takes most of the time [m]."""
    stops_ahead: int = Field(8, ge=1)
    """So many stops are planned; what comes after them belongs to later plans."""
    subspace_views: SubspaceViewsConfig = SubspaceViewsConfig()
    """How the views of open subspaces are found, near and far."""


class GainFirst:
    """The policy. Keeps the views of open subspaces, and the stops that it wanted last."""

    def __init__(self, config: GainFirstConfig, context: PlannerContext) -> None:
        self._config = config
        self._subspaces = SubspaceViews(
            config.subspace_views,
            gain_threshold=config.gain_threshold,
            camera_range_m=context.camera_range_m,
        )
        self._travel = TravelTimes(context.robot, turning_weight=config.turning_weight)
        self._wanted_m: Float[ndarray, "n 2"] = np.zeros((0, 2))
        self._expected = 0.0
        """The gain of the first of them."""
        self._enough = 1.0
        """A stop must be worth so much of the thresholds."""

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice:
        found = self._subspaces.update(cycle, rng, whole_map=True)
        near = self._sampled(cycle, rng, found.in_horizon)
        worth, rejected = self._sifted(cycle, near)
        far = self._renewed(cycle, found.goals)
        if not worth and not far:
            # Before giving up: every open subspace, scored anew.
            self._settle_for_less(cycle)
            again = self._subspaces.update(cycle, rng, whole_map=True)
            worth, rejected = self._sifted(cycle, [*near, *again.in_horizon])
            far = again.goals
            rejected += again.rejected
            found.unreachable += again.unreachable
        stops = self._ordered(cycle, [*worth, *far])
        later = [view for view in [*worth, *far] if not any(view is stop for stop in stops)]
        self._wanted_m = np.array([view.xy_m for view in stops]).reshape(-1, 2)
        self._expected = stops[0].total_gain if stops else 0.0
        return Choice(
            stops=stops,
            outranked=later,
            rejected=[*rejected, *found.rejected],
            unreachable_m=found.unreachable,
            threshold=self._enough * self._config.gain_threshold,
            reason=self._explained(worth, far, rejected, found),
        )

    def why_drop(self, view: View, yaw_rad: float, away_m: float) -> str | None:
        gain = view.gain_at(yaw_rad)
        if gain < self._config.abandon_share * float(self._threshold(np.array([away_m]))[0]):
            self._subspaces.forget_at(view.xy_m)
            return f"target already seen: only gain {gain:.2f} is left of it"
        if gain < self._config.abandon_share * self._expected:
            return f"only gain {gain:.2f} is left of the target's {self._expected:.2f}"
        return None

    def reconsider(self) -> None:
        self._subspaces.forget()
        self._demand(1.0)

    def state(self) -> dict[str, Any]:
        return {
            "subspaces": self._subspaces.state(),
            "wanted_m": self._wanted_m.copy(),
            "expected": self._expected,
            "enough": self._enough,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._subspaces.restore(state["subspaces"])
        self._wanted_m = np.array(state["wanted_m"], dtype=np.float64).reshape(-1, 2)
        self._expected = float(state["expected"])
        self._demand(float(state["enough"]))

    def _threshold(self, away_m: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """What a stop must be worth after so long a way."""
        config = self._config
        share = np.minimum(away_m / config.full_price_m, 1.0)
        threshold: Float[ndarray, " n"] = config.glance_threshold + share * (
            config.gain_threshold - config.glance_threshold
        )
        return self._enough * threshold

    def _demand(self, share: float) -> None:
        """From now on a stop must be worth so much of the thresholds."""
        self._enough = share
        self._subspaces.gain_threshold = share * self._config.gain_threshold

    def _settle_for_less(self, cycle: PlanningCycle) -> None:
        self._subspaces.forget()
        if self._enough > self._config.last_share:
            self._demand(self._config.last_share)
            cycle.partition.reopen_exhausted()

    def _sifted(self, cycle: PlanningCycle, views: list[View]) -> tuple[list[View], list[View]]:
        """The views that are worth a stop, and the others."""
        worth: list[View] = []
        rejected: list[View] = []
        for view, least in zip(views, self._threshold(self._travel.driving_m(cycle, views)), strict=True):
            (worth if view.total_gain >= least else rejected).append(view)
        return worth, rejected

    def _sampled(self, cycle: PlanningCycle, rng: np.random.Generator, suggested: list[View]) -> list[View]:
        """Views inside the horizon: from the robot's place, from those that were wanted before or suggested
        by subspaces, and from places between them all."""
        spacing_m = self._config.sample_spacing_m
        kept = cycle.places_apart([*self._wanted_m, *(view.xy_m for view in suggested)], spacing_m)
        places = cycle.places_in_horizon()
        room_m = cycle.grid.radius_m + cycle.grid.margin_m - 1e-6
        places = places[cycle.grid.clearance_m.ravel()[places] >= room_m]
        between = poisson_disk(cycle.grid.centres_m(places), spacing_m, rng, taken_m=cycle.taken_m(kept))
        cells = np.concatenate([kept, places[between]])
        thinned = poisson_disk(cycle.grid.centres_m(cells), self._config.quality_spacing_m, rng)
        full = np.isin(np.arange(len(cells)), thinned)
        views = [*cycle.score(cells[full]), *cycle.score(cells[~full], coverage_only=True)]
        return [*cycle.score_here(), *views]

    def _renewed(self, cycle: PlanningCycle, goals: list[View]) -> list[View]:
        """The goals as the newest maps see them; what is no longer worth a stop is searched for anew in the
        next cycle."""
        renewed = cycle.score(np.array([view.cell for view in goals], np.int64), coverage_only=True)
        worth = []
        for goal, view in zip(goals, renewed, strict=True):
            if view.total_gain >= self._subspaces.gain_threshold:
                worth.append(view)
            else:
                self._subspaces.forget_at(goal.xy_m)
        return worth

    def _ordered(self, cycle: PlanningCycle, views: list[View]) -> list[View]:
        """The first few of those that are needed, in the order that gains most early."""
        if not views:
            return []
        views, gains = self._distinct(cycle, views)
        next_m = self._wanted_m[0] if len(self._wanted_m) else None
        if next_m is not None and np.hypot(*(next_m - cycle.robot_xy_m)) <= _SAME_PLACE_M:
            next_m = None
        costs = self._travel.committed_times_s(cycle, views, next_m, self._config.commitment_s)
        best, urgent = float(gains.max()), self._config.urgent_gain
        leads_to = gains * (1.0 + gains / urgent)
        order = least_latency_order(costs, leads_to, urgency=best / (best + urgent))
        return [views[k - 1] for k in order[: self._config.stops_ahead].tolist()]

    def _distinct(self, cycle: PlanningCycle, views: list[View]) -> tuple[list[View], Float[ndarray, " n"]]:
        """The views that are needed, and what each adds to the others."""
        overlap = Overlap(np.array([view.total_gain for view in views]), cycle.new_surface_in_view(views))
        away_m = self._travel.driving_m(cycle, views)
        rows, gains = distinct_views(
            overlap, away_m, thresholds=self._threshold(away_m), patience_m=self._config.patience_m
        )
        return [views[row] for row in rows], gains

    def _explained(
        self, worth: list[View], far: list[View], rejected: list[View], found: OpenSubspaces
    ) -> str:
        if not worth and not far:
            best = max((view.total_gain for view in rejected), default=0.0)
            return (
                f"no reachable view gains {self._subspaces.gain_threshold:.2f} or more, the best {best:.2f}"
            )
        parts = []
        if worth:
            best = max(view.total_gain for view in worth)
            parts.append(f"{len(worth)} views worth a stop nearby (best gain {best:.2f})")
        else:
            parts.append("nothing nearby is worth a stop")
        if far:
            parts.append(f"{len(far) + found.n_waiting} unfinished subspaces farther away")
        return "; ".join(parts)


def _build(config: GainFirstConfig, context: PlannerContext) -> NextBestViewPlanner:
    evaluator = build_evaluator(config.gain, context.camera, context.camera_range_m)
    return NextBestViewPlanner(config, context, evaluator, GainFirst(config, context))


METHOD = PlannerMethod(config=GainFirstConfig, build=_build)
