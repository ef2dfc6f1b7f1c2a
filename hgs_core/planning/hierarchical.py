"""`HierarchicalPlanner`: HGS-Planner section III-D, the global tour and the local views of Algorithm 1
joined.

One cycle: where can the robot drive (navigation grid), what is missing where (subspaces), in which order to
visit what lies outside the horizon (global tour), which views inside it are worth a stop and in which order
(local tour), and the path that joins both. The answer is a path or "nothing left", with what stays unseen and
why.

Reads the voxel map, the robot's state and the gain evaluator's scores; decides the same way again for the
same random generator.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.gain.registry import build_evaluator
from hgs_core.gain.viewpoint import GainEvaluator
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.executable_path import (
    CAR_LEGS,
    CAR_TRIES,
    NO_WAY,
    Route,
    car_route,
    first_exit,
    join_views,
)
from hgs_core.planning.global_planner import GlobalPlanner, GlobalTour
from hgs_core.planning.local_planner import LocalPlanner, LocalViews
from hgs_core.planning.plan import (
    Candidate,
    NothingLeft,
    Plan,
    PlanningTimes,
    on_floor,
)
from hgs_core.planning.registry import PlannerMethod
from hgs_core.planning.roadmap import Roadmap
from hgs_core.planning.subspace_views import SubspaceViews
from hgs_core.planning.survey import PlannerContext, Survey
from hgs_core.planning.surveying import SurveyingPlanner
from hgs_core.planning.views import View
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState


class HierarchicalPlanner(SurveyingPlanner):
    """The paper's planner. Raises `PlanningError` when asked to plan on an empty voxel map."""

    def __init__(self, config: HierarchicalConfig, context: PlannerContext, evaluator: GainEvaluator) -> None:
        super().__init__(Survey(config, context, evaluator, horizon_m=config.local_level.horizon_m))
        self.config = config
        self._partition = self._survey.partition
        self._pursuit = self._survey.pursuit
        self._scorer = self._survey.scorer
        self._global = GlobalPlanner(
            config.global_level,
            views=SubspaceViews(
                config.global_level,
                gain_threshold=config.gain_threshold,
                camera_range_m=context.camera_range_m,
            ),
            roadmap=Roadmap(config.roadmap),
        )
        self._local = LocalPlanner(config.local_level, context.robot, gain_threshold=config.gain_threshold)

    def plan(self, snapshot: MapSnapshot, robot: RobotState, rng: np.random.Generator) -> Plan | NothingLeft:
        """One planning cycle."""
        began = time.perf_counter()
        self._scorer.elapsed_s = 0.0
        cycle = self._survey.cycle(snapshot, robot)
        self._survey.remember_views_taken(cycle)
        self._global.roadmap.grow(cycle.grid, cycle.reach, rng)
        tour, local, route, global_s = self._routed(cycle, rng, began)
        path = route.path
        local_s = time.perf_counter() - began - global_s - self._scorer.elapsed_s
        times = PlanningTimes(
            viewpoint_evaluation_s=self._scorer.elapsed_s, local_s=local_s, global_s=global_s
        )
        if not route.views:
            self._pursuit.drop()
            return self._nothing_left(cycle, tour, local, times)
        yaws = path.yaws_rad[np.isfinite(path.yaws_rad)]
        gains = [view.undiscounted_gain_at(float(yaw)) for view, yaw in zip(route.views, yaws, strict=True)]
        self._pursuit.follow(path, np.array(gains), cycle.grid, robot.timestamp_s)
        return Plan(
            path=path,
            candidates=self._candidates(tour, local),
            subspaces=self._partition.listing(),
            global_tour_m=on_floor(np.concatenate([cycle.robot_xy_m[None], tour.polyline_m])),
            local_path_m=on_floor(path.positions_m),
            horizon=cycle.horizon,
            observed_share=cycle.observed_share,
            reason=self._explain(cycle, tour, local, path),
            times=times,
            coverage_unit=self.config.gain.coverage_unit,
        )

    def _routed(
        self, cycle: PlanningCycle, rng: np.random.Generator, began: float
    ) -> tuple[GlobalTour, LocalViews, Route, float]:
        """Both levels' answers, the way that joins them, and the global level's wall seconds.

        Where a car finds a way to none of the views, both are asked again, and believe less in those.
        """
        tour, local, global_s = self._chosen(cycle, rng, began)
        if cycle.car is None:
            stops = [*local.tour, *tour.goals[:1]]
            return tour, local, Route(path=self._path(cycle, tour, stops), views=stops), global_s
        for _ in range(CAR_TRIES):
            stops = [*local.tour, *tour.goals[:CAR_LEGS]]
            route = car_route(cycle, cycle.car, stops)
            if route.views or not stops:
                return tour, local, route, global_s
            self._survey.remember_no_way(stops)
            tour, local, _ = self._chosen(cycle, rng, began)
        return tour, local, Route(path=Path.empty(), views=[]), global_s

    def _chosen(
        self, cycle: PlanningCycle, rng: np.random.Generator, began: float
    ) -> tuple[GlobalTour, LocalViews, float]:
        """The global tour, the local views, and the seconds that the former took."""
        tour = self._global.tour(cycle, rng, whole_map=False)
        global_s = time.perf_counter() - began - self._scorer.elapsed_s

        local = self._local.select(
            cycle,
            rng,
            crossing_cell=self._crossing_cell(cycle, tour),
            carried_m=self._pursuit.views_ahead_m(),
            suggested=tour.open.in_horizon,
        )
        if not local.tour and not tour.goals:
            # Before giving up: every open subspace of the whole map, scored anew.
            self._global.views.forget()
            again = self._global.tour(cycle, rng, whole_map=True)
            tour = self._merged(tour, again)
            ordered = self._local.order(cycle, tour.open.in_horizon, None, None)
            local = LocalViews(tour=ordered, rejected=local.rejected, crossing=None)
        return tour, local, global_s

    def should_replan(
        self, snapshot: MapSnapshot, robot: RobotState, plan: Plan, waypoints_passed: int
    ) -> str | None:
        """`blocked ...` when the remaining path lost its clearance on the newest map; `target already seen
        ...` when little of the next view's gain is left (looked at every `recheck_interval_s`)."""
        blocked = self._survey.why_blocked(snapshot, robot, plan.path, waypoints_passed)
        if blocked is not None or not self._pursuit.recheck_due(robot.timestamp_s):
            return blocked
        ahead = self._survey.next_view(snapshot, robot, plan.path, waypoints_passed)
        if ahead is None:
            return None
        view, yaw = ahead
        gain = view.gain_at(yaw)
        if gain >= self.config.abandon_share * self.config.gain_threshold:
            return None
        self._global.views.forget_at(view.xy_m)
        return f"target already seen: only gain {gain:.2f} is left of it"

    def _roadmap_m(self) -> Float[ndarray, "n_edges 2 2"]:
        return self._global.roadmap.usable_m

    def _reconsider(self) -> None:
        self._global.views.forget()

    def state(self) -> dict[str, Any]:
        """Everything that the next cycle depends on, as plain data."""
        return {"survey": self._survey.state(), "global": self._global.state()}

    def restore(self, state: dict[str, Any]) -> None:
        self._survey.restore(state["survey"])
        self._global.restore(state["global"])

    @staticmethod
    def _crossing_cell(cycle: PlanningCycle, tour: GlobalTour) -> int | None:
        if not tour.legs_m or not cycle.is_place.any():
            return None
        exit_m = first_exit(tour.legs_m[0], cycle)
        return None if exit_m is None else cycle.nearest_place(exit_m)

    @staticmethod
    def _merged(before: GlobalTour, after: GlobalTour) -> GlobalTour:
        """The second tour of a cycle, with what the first one rejected."""
        after.open.rejected = before.open.rejected + after.open.rejected
        after.open.unreachable = before.open.unreachable + after.open.unreachable
        return after

    @staticmethod
    def _path(cycle: PlanningCycle, tour: GlobalTour, stops: list[View]) -> Path:
        """Local views, then the first goal of the global tour. Further goals belong to later plans."""
        if len(stops) == 1 and tour.goals:
            leg = tour.legs_m[0]
            yaws = np.full(len(leg), np.nan)
            step = leg[-1] - leg[-2]
            yaws[-1] = stops[0].yaw_near(float(np.arctan2(step[1], step[0])))
            return Path(positions_m=leg, yaws_rad=yaws)
        return join_views(cycle, stops)

    def _candidates(self, tour: GlobalTour, local: LocalViews) -> tuple[Candidate, ...]:
        return self._survey.considered(
            selected=[*local.tour, *tour.goals],
            crossing=local.crossing,
            outranked=[],
            rejected=[*local.rejected, *tour.open.rejected],
            unreachable_m=tour.open.unreachable,
            threshold=self.config.gain_threshold,
        )

    def _explain(self, cycle: PlanningCycle, tour: GlobalTour, local: LocalViews, path: Path) -> str:
        parts = []
        if cycle.reach.escaping:
            parts.append("leaving a place that has become too tight")
        if local.tour:
            best = max(view.total_gain for view in local.tour)
            parts.append(f"{len(local.tour)} views worth a stop nearby (best gain {best:.2f})")
        else:
            parts.append("nothing nearby is worth a stop")
        if tour.goals:
            n_open = len(tour.goals) + tour.open.n_waiting
            parts.append(
                f"then {n_open} unfinished subspaces farther away"
                if local.tour
                else f"going to the first of {n_open} unfinished subspaces farther away"
            )
        if tour.grid_legs:
            parts.append(
                f"{tour.grid_legs} ways found on the grid, where the roadmap has no short connection"
            )
        return "; ".join(parts) + f"; {path.length_m:.1f} m planned"

    def _nothing_left(
        self, cycle: PlanningCycle, tour: GlobalTour, local: LocalViews, times: PlanningTimes
    ) -> NothingLeft:
        unseen = self._survey.unseen(cycle)
        best = max((view.total_gain for view in local.rejected), default=0.0)
        if local.tour or tour.goals:
            why = NO_WAY
        else:
            why = f"no reachable view gains {self.config.gain_threshold:.2f} or more, the best {best:.2f}"
        return NothingLeft(
            unseen=unseen,
            candidates=self._candidates(tour, local),
            subspaces=self._partition.listing(),
            times=times,
            reason=self._survey.why_nothing(cycle, unseen, why),
        )


def _build(config: HierarchicalConfig, context: PlannerContext) -> HierarchicalPlanner:
    return HierarchicalPlanner(
        config, context, build_evaluator(config.gain, context.camera, context.camera_range_m)
    )


METHOD = PlannerMethod(config=HierarchicalConfig, build=_build)
