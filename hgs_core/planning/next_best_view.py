"""What most planners share: survey, let a policy choose views, drive to them.

A policy is one way of choosing the next views. Everything else is the same for all of them: the
navigation grid, the paths over it, the camera's yaws, the memory that believes less in gains that did not
drop (without it none of them would be sure to end), and the answer for what stays unseen.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field

from hgs_core.gain.viewpoint import GainEvaluator
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.executable_path import CAR_TRIES, NO_WAY, Route, car_route, join_views
from hgs_core.planning.plan import (
    Candidate,
    NothingLeft,
    Plan,
    PlanningTimes,
    UnseenReason,
    UnseenRegion,
    on_floor,
)
from hgs_core.planning.survey import PlannerContext, Survey
from hgs_core.planning.surveying import SurveyingPlanner
from hgs_core.planning.views import View
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState


class NextBestViewConfig(PlannerConfig):
    """What every policy has beside `PlannerConfig`."""

    horizon_m: float = Field(6.0, gt=0)
    """Edge of the square about the robot that counts as its surroundings [m]."""


@dataclass(kw_only=True, eq=False)
class Choice:
    """What a policy wants."""

    stops: list[View]
    """Where to look next, in order; none: nothing is left. Driving stops at each, and each brings a new
    choice."""
    rejected: list[View] = field(default_factory=list)
    """What was considered as well, and is not worth a stop."""
    outranked: list[View] = field(default_factory=list)
    """What is worth a stop, too, but comes later, if at all."""
    unreachable_m: list[Float[ndarray, " 2"]] = field(default_factory=list)
    """Middles of what is missing where no reachable place can look at it."""
    threshold: float | None = None
    """The total gain that a stop must be worth; None: what the settings say, if they do."""
    reason: str
    """Why these, or why none: one clause for an operator."""


@runtime_checkable
class Policy(Protocol):
    """One way of choosing views."""

    def choose(self, cycle: PlanningCycle, rng: np.random.Generator) -> Choice: ...

    def state(self) -> dict[str, Any]:
        """What the next choice depends on besides the cycle, as plain data."""
        ...

    def restore(self, state: dict[str, Any]) -> None: ...


@runtime_checkable
class Reconsidering(Protocol):
    """A policy that keeps conclusions from one choice to the next."""

    def reconsider(self) -> None:
        """The operator's wishes have changed: what was given up may be worth a view again."""
        ...


@runtime_checkable
class Rechecking(Protocol):
    """A policy that looks again at the next view while the robot drives to it."""

    def why_drop(self, view: View, yaw_rad: float, away_m: float) -> str | None:
        """Why the view, as the newest maps see it and at least so far away, is not worth going on to; None
        when it is."""
        ...


class NextBestViewPlanner(SurveyingPlanner):
    """A `Planner` around a policy. Raises `PlanningError` when asked to plan on an empty voxel map."""

    def __init__(
        self, config: NextBestViewConfig, context: PlannerContext, evaluator: GainEvaluator, policy: Policy
    ) -> None:
        super().__init__(Survey(config, context, evaluator, horizon_m=config.horizon_m))
        self.config = config
        self._policy = policy

    def plan(self, snapshot: MapSnapshot, robot: RobotState, rng: np.random.Generator) -> Plan | NothingLeft:
        """One planning cycle."""
        began = time.perf_counter()
        scorer, pursuit = self._survey.scorer, self._survey.pursuit
        scorer.elapsed_s = 0.0
        cycle = self._survey.cycle(snapshot, robot)
        self._survey.remember_views_taken(cycle)
        choice, route = self._routed_choice(cycle, rng)
        path = route.path
        local_s = time.perf_counter() - began - scorer.elapsed_s
        times = PlanningTimes(viewpoint_evaluation_s=scorer.elapsed_s, local_s=local_s, global_s=0.0)
        if not route.views:
            pursuit.drop()
            unseen = tuple(_given_up(region) for region in self._survey.unseen(cycle))
            return NothingLeft(
                unseen=unseen,
                candidates=self._candidates(choice),
                subspaces=self._survey.partition.listing(),
                times=times,
                reason=self._survey.why_nothing(cycle, unseen, choice.reason),
            )
        yaws = path.yaws_rad[np.isfinite(path.yaws_rad)]
        gains = [view.undiscounted_gain_at(float(yaw)) for view, yaw in zip(route.views, yaws, strict=True)]
        pursuit.follow(path, np.array(gains), cycle.grid, robot.timestamp_s)
        return Plan(
            path=path,
            candidates=self._candidates(choice),
            subspaces=self._survey.partition.listing(),
            global_tour_m=np.zeros((0, 3)),
            local_path_m=on_floor(path.positions_m),
            horizon=cycle.horizon,
            observed_share=cycle.observed_share,
            reason=f"{choice.reason}; {path.length_m:.1f} m planned",
            times=times,
            coverage_unit=self.config.gain.coverage_unit,
        )

    def _routed_choice(self, cycle: PlanningCycle, rng: np.random.Generator) -> tuple[Choice, Route]:
        """What the policy wants and the way there. Where a car finds a way to none of it, the policy is asked
        again, and believes less in those views."""
        choice = self._policy.choose(cycle, rng)
        if cycle.car is None:
            return choice, Route(path=join_views(cycle, choice.stops), views=choice.stops)
        for _ in range(CAR_TRIES):
            route = car_route(cycle, cycle.car, choice.stops)
            if route.views or not choice.stops:
                return choice, route
            self._survey.remember_no_way(choice.stops)
            choice = self._policy.choose(cycle, rng)
        return Choice(stops=[], rejected=choice.stops, reason=NO_WAY), Route(path=Path.empty(), views=[])

    def should_replan(
        self, snapshot: MapSnapshot, robot: RobotState, plan: Plan, waypoints_passed: int
    ) -> str | None:
        """When the remaining path lost its clearance on the newest map; for a `Rechecking` policy also when
        it drops the next view, every `recheck_interval_s`."""
        survey, policy = self._survey, self._policy
        blocked = survey.why_blocked(snapshot, robot, plan.path, waypoints_passed)
        if blocked is not None or not isinstance(policy, Rechecking):
            return blocked
        if not survey.pursuit.recheck_due(robot.timestamp_s):
            return None
        ahead = survey.next_view(snapshot, robot, plan.path, waypoints_passed)
        if ahead is None:
            return None
        view, yaw_rad = ahead
        return policy.why_drop(view, yaw_rad, float(np.hypot(*(view.xy_m - [robot.x_m, robot.y_m]))))

    def _reconsider(self) -> None:
        if isinstance(self._policy, Reconsidering):
            self._policy.reconsider()

    def state(self) -> dict[str, Any]:
        return {"survey": self._survey.state(), "policy": self._policy.state()}

    def restore(self, state: dict[str, Any]) -> None:
        self._survey.restore(state["survey"])
        self._policy.restore(state["policy"])

    def _candidates(self, choice: Choice) -> tuple[Candidate, ...]:
        return self._survey.considered(
            selected=choice.stops,
            outranked=choice.outranked,
            rejected=choice.rejected,
            unreachable_m=choice.unreachable_m,
            threshold=getattr(self.config, "gain_threshold", None)
            if choice.threshold is None
            else choice.threshold,
        )


def _given_up(region: UnseenRegion) -> UnseenRegion:
    """Subspaces that are still open when a policy finds nothing left were not worth a view to it."""
    if region.reason is not UnseenReason.INTERRUPTED:
        return region
    return replace(region, reason=UnseenReason.BELOW_THRESHOLD)
