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
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.gain.viewpoint import GainEvaluator
from hgs_core.geometry.boxes import Box
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.executable_path import first_exit, join_views
from hgs_core.planning.floor_survey import FloorSurvey
from hgs_core.planning.global_planner import GlobalPlanner, GlobalTour
from hgs_core.planning.local_planner import LocalPlanner, LocalViews
from hgs_core.planning.low_obstacles import TouchMemory
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import reach_from
from hgs_core.planning.plan import (
    Candidate,
    CandidateStatus,
    NothingLeft,
    Plan,
    PlanningTimes,
    UnseenRegion,
)
from hgs_core.planning.pursuit import Pursuit
from hgs_core.planning.roadmap import Roadmap
from hgs_core.planning.subspaces import SubspacePartition, horizon_around
from hgs_core.planning.unseen import unseen_regions
from hgs_core.planning.views import View, ViewMemory, ViewScorer
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState

__all__ = ["HierarchicalPlanner", "PlannerConfig"]


class HierarchicalPlanner:
    """The paper's planner. Raises `PlanningError` when asked to plan on an empty voxel map.

    `region` bounds where viewpoints may be; without it, the whole map counts.
    """

    def __init__(
        self,
        config: PlannerConfig,
        robot: RobotConfig,
        evaluator: GainEvaluator,
        *,
        camera_height_m: float,
        camera_range_m: float,
        region: Box | None = None,
    ) -> None:
        self.config = config
        self._robot = robot
        self._region = region
        self._camera_range_m = camera_range_m
        self._memory = ViewMemory(config.memory)
        self._scorer = ViewScorer(evaluator, self._memory, camera_height_m)
        origin = np.zeros(2) if region is None else np.array(region.lower_m[:2], dtype=np.float64)
        self._partition = SubspacePartition(config.subspaces, origin_m=origin)
        self._global = GlobalPlanner(
            config.global_level,
            partition=self._partition,
            roadmap=Roadmap(config.roadmap),
            gain_threshold=config.gain_threshold,
            camera_range_m=camera_range_m,
        )
        self._local = LocalPlanner(config.local_level, robot, gain_threshold=config.gain_threshold)
        self._touches = TouchMemory()
        self._floor = FloorSurvey(config.navigation, robot, sight_m=camera_range_m)
        self._pursuit = Pursuit(config, robot, self._touches)

    def plan(self, snapshot: MapSnapshot, robot: RobotState, rng: np.random.Generator) -> Plan | NothingLeft:
        """One planning cycle."""
        began = time.perf_counter()
        self._scorer.elapsed_s = 0.0
        cycle = self._survey(snapshot, robot)
        self._remember_views_taken(cycle)
        self._global.roadmap.grow(cycle.grid, cycle.reach, rng)
        tour = self._global.tour(cycle, rng, whole_map=False)
        global_s = time.perf_counter() - began - self._scorer.elapsed_s

        local = self._local.select(
            cycle,
            rng,
            crossing_cell=self._crossing_cell(cycle, tour),
            carried_m=self._pursuit.views_ahead_m(),
            suggested=tour.in_horizon,
        )
        if not local.tour and not tour.goals:
            # Before giving up: every open subspace of the whole map, scored anew.
            self._global.forget_views()
            tour = self._merged(tour, self._global.tour(cycle, rng, whole_map=True))
            ordered = self._local.order(cycle, tour.in_horizon, None, None)
            local = LocalViews(tour=ordered, rejected=local.rejected, crossing=None)
        stops = [*local.tour, *tour.goals[:1]]
        path = self._path(cycle, tour, stops)
        local_s = time.perf_counter() - began - global_s - self._scorer.elapsed_s
        times = PlanningTimes(
            viewpoint_evaluation_s=self._scorer.elapsed_s, local_s=local_s, global_s=global_s
        )
        if not stops:
            self._pursuit.drop()
            return self._nothing_left(cycle, tour, local, times)
        yaws = path.yaws_rad[np.isfinite(path.yaws_rad)]
        gains = [view.undiscounted_gain_at(float(yaw)) for view, yaw in zip(stops, yaws, strict=True)]
        self._pursuit.follow(path, np.array(gains), cycle.grid, robot.timestamp_s)
        return Plan(
            path=path,
            candidates=self._candidates(tour, local),
            subspaces=self._partition.listing(),
            global_tour_m=_on_floor(np.concatenate([cycle.robot_xy_m[None], tour.polyline_m])),
            local_path_m=_on_floor(path.positions_m),
            horizon=cycle.horizon,
            observed_share=cycle.observed_share,
            reason=self._explain(cycle, tour, local, path),
            times=times,
        )

    def should_replan(
        self, snapshot: MapSnapshot, robot: RobotState, plan: Plan, waypoints_passed: int
    ) -> str | None:
        """`blocked ...` when the remaining path lost its clearance on the newest map; `target already seen
        ...` when little of the next view's gain is left (looked at every `recheck_interval_s`)."""
        blocked = self._pursuit.why_blocked(snapshot, robot, plan.path, waypoints_passed)
        if blocked is not None or not self._pursuit.recheck_due(robot.timestamp_s):
            return blocked
        ahead = np.flatnonzero(np.isfinite(plan.path.yaws_rad[waypoints_passed:])) + waypoints_passed
        if not len(ahead):
            return None
        place, yaw = plan.path.positions_m[ahead[0]], float(plan.path.yaws_rad[ahead[0]])
        voxels = snapshot.voxels
        here = np.array([robot.x_m, robot.y_m])
        share = voxels.observed_share(horizon_around(here, self.config.local_level.horizon_m, voxels))
        (view,) = self._scorer.score(snapshot, place[None], [-1], share)
        gain = view.gain_at(yaw)
        if gain >= self.config.abandon_share * self.config.gain_threshold:
            return None
        self._global.forget_view_at(place)
        return f"target already seen: only gain {gain:.2f} is left of it"

    def unseen(self, snapshot: MapSnapshot, robot: RobotState) -> tuple[UnseenRegion, ...]:
        """What is unseen now. Regions that were still to be visited have the reason `INTERRUPTED`."""
        if not snapshot.voxels.states.size:
            return ()
        return self._unseen(self._survey(snapshot, robot))

    def state(self) -> dict[str, Any]:
        """Everything that the next cycle depends on, as plain data."""
        return {
            "global": self._global.state(),
            "memory": self._memory.state(),
            "pursuit": self._pursuit.state(),
            "touches": self._touches.state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._global.restore(state["global"])
        self._memory.restore(state["memory"])
        self._pursuit.restore(state["pursuit"])
        self._touches.restore(state["touches"])

    def _remember_views_taken(self, cycle: PlanningCycle) -> None:
        """Also how much of each view's gain is still promised now that it was taken."""
        robot = cycle.robot
        for x_m, y_m, yaw_rad, predicted in self._pursuit.views_taken_at(robot).tolist():
            place = np.array([[x_m, y_m]])
            (view,) = self._scorer.score(cycle.snapshot, place, [-1], cycle.observed_share)
            remaining = view.undiscounted_gain_at(yaw_rad) / max(predicted, 1e-9)
            self._memory.add(x_m, y_m, yaw_rad, remaining_share=remaining)
        self._memory.current = (robot.x_m, robot.y_m, robot.yaw_rad)

    def _survey(self, snapshot: MapSnapshot, robot: RobotState) -> PlanningCycle:
        """What the maps say, once for both levels."""
        voxels = snapshot.voxels
        if not voxels.states.size:
            raise PlanningError("the voxel map is empty: integrate a frame before planning")
        here = np.array([robot.x_m, robot.y_m])
        self._touches.notice(robot, self._robot.radius_m)
        grid = self._floor.grid(voxels, snapshot.gaussians, robot_xy_m=here, touched_m=self._touches.points_m)
        reach = reach_from(grid, here)
        horizon = horizon_around(here, self.config.local_level.horizon_m, voxels)
        return PlanningCycle(
            snapshot=snapshot,
            robot=robot,
            grid=grid,
            reach=reach,
            is_place=reach.reachable & self._in_region(grid),
            horizon=horizon,
            missing=self._partition.update(voxels),
            observed_share=voxels.observed_share(horizon),
            preferred_clearance_m=self.config.navigation.preferred_clearance_m,
            scorer=self._scorer,
        )

    def _in_region(self, grid: NavigationGrid) -> Bool[ndarray, "nx ny"]:
        """Cells with centres inside the region."""
        inside = np.ones(grid.shape, bool)
        if self._region is None:
            return inside
        for axis, n in enumerate(grid.shape):
            centres = grid.lower_m[axis] + (np.arange(n) + 0.5) * grid.size_m
            along = (centres >= self._region.lower_m[axis]) & (centres < self._region.upper_m[axis])
            inside &= along[:, None] if axis == 0 else along[None, :]
        return inside

    @staticmethod
    def _crossing_cell(cycle: PlanningCycle, tour: GlobalTour) -> int | None:
        if not tour.legs_m or not cycle.is_place.any():
            return None
        exit_m = first_exit(tour.legs_m[0], cycle)
        return None if exit_m is None else cycle.nearest_place(exit_m)

    @staticmethod
    def _merged(before: GlobalTour, after: GlobalTour) -> GlobalTour:
        """The second tour of a cycle, with what the first one rejected."""
        after.rejected = before.rejected + after.rejected
        after.unreachable = before.unreachable + after.unreachable
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
        z_m = self._scorer.camera_height_m
        selected = [*local.tour, *tour.goals]
        candidates = [view.as_candidate(CandidateStatus.SELECTED, z_m) for view in selected]
        if local.crossing is not None:
            candidates.append(local.crossing.as_candidate(CandidateStatus.CROSSING, z_m))
        rejected = [*local.rejected, *tour.rejected]
        candidates += [view.as_candidate(CandidateStatus.BELOW_THRESHOLD, z_m) for view in rejected]
        candidates += [
            Candidate(
                x_m=float(middle[0]),
                y_m=float(middle[1]),
                z_m=z_m,
                yaw_rad=0.0,
                coverage_gain=0.0,
                quality_gain=0.0,
                total_gain=0.0,
                status=CandidateStatus.UNREACHABLE,
            )
            for middle in tour.unreachable
        ]
        return tuple(candidates)

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
            n_open = len(tour.goals) + tour.n_waiting
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
        unseen = self._unseen(cycle)
        return NothingLeft(
            unseen=unseen,
            candidates=self._candidates(tour, local),
            subspaces=self._partition.listing(),
            times=times,
            reason=self._why_nothing(cycle, local, unseen),
        )

    def _why_nothing(self, cycle: PlanningCycle, local: LocalViews, unseen: tuple[UnseenRegion, ...]) -> str:
        volume = sum(region.volume_m3 for region in unseen)
        left = (
            f"{len(unseen)} regions of {volume:.1f} m^3 together stay unseen"
            if unseen
            else "nothing is missing"
        )
        n_places = int(np.count_nonzero(cycle.is_place))
        if not n_places:
            radius = self._robot.radius_m
            return (
                "the robot cannot leave its place: no floor around it has been seen free with "
                f"{radius:.2f} m of room on every side (is something closer than that, or does no sensor see "
                f"the floor nearby?); {left}"
            )
        best = max((view.total_gain for view in local.rejected), default=0.0)
        area = n_places * cycle.grid.size_m**2
        return (
            f"no reachable view gains {self.config.gain_threshold:.2f} or more "
            f"(best {best:.2f}; the robot can stand on {area:.1f} m^2 of floor); {left}"
        )

    def _unseen(self, cycle: PlanningCycle) -> tuple[UnseenRegion, ...]:
        return unseen_regions(
            cycle.snapshot.voxels,
            self._partition,
            cycle.grid.centres_m(np.flatnonzero(cycle.is_place)),
            camera_range_m=self._camera_range_m,
            region=self._region,
        )


def _on_floor(polyline_m: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    return np.column_stack([polyline_m, np.zeros(len(polyline_m))])
