"""What every planner knows of the world before it chooses: surveyed once a cycle, the same for all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.gain.viewpoint import GainEvaluator, GainPanorama, Panoramic
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.car_ways import CarWays
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.directives import Directives
from hgs_core.planning.floor_survey import FloorSurvey
from hgs_core.planning.focus import Focus
from hgs_core.planning.low_obstacles import TouchMemory
from hgs_core.planning.navigation_grid import NavigationGrid, build_navigation_grid
from hgs_core.planning.path_budget import PathBudget
from hgs_core.planning.path_search import reach_from, reach_from_cells
from hgs_core.planning.plan import Candidate, CandidateStatus, Plan, UnseenReason, UnseenRegion
from hgs_core.planning.pursuit import Pursuit
from hgs_core.planning.subspaces import SubspacePartition, horizon_around
from hgs_core.planning.unseen import unseen_regions
from hgs_core.planning.views import View, ViewMemory, ViewScorer, observed_around
from hgs_core.planning.zones import Zones
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState


@dataclass(frozen=True, kw_only=True)
class PlannerContext:
    """What a planner is told of its robot when it is built; nothing else of the world reaches it."""

    robot: RobotConfig
    camera: CameraIntrinsics
    camera_height_m: float
    camera_range_m: float
    region: Box | None = None
    """Bounds of where viewpoints may be; None: the whole map."""


class Survey:
    """Where the robot can drive and what is missing, and what became of the views on its way.

    `horizon_m` is the edge of the square about the robot over which the observed share is taken.
    """

    def __init__(
        self,
        config: PlannerConfig,
        context: PlannerContext,
        evaluator: GainEvaluator,
        *,
        horizon_m: float,
    ) -> None:
        self.config = config
        self.context = context
        self._evaluator = evaluator
        self.memory = ViewMemory(config.memory)
        self.scorer = ViewScorer(evaluator, self.memory, context.camera_height_m)
        region = context.region
        origin = np.zeros(2) if region is None else np.array(region.lower_m[:2], dtype=np.float64)
        self.partition = SubspacePartition(config.subspaces, origin_m=origin)
        self._touches = TouchMemory()
        self.pursuit = Pursuit(config, context.robot, self._touches)
        self._floor = FloorSurvey(config.navigation, context.robot, sight_m=context.camera_range_m)
        self._horizon_m = horizon_m
        self._directives = Directives()
        self._zones = Zones(self._directives)
        self._budget: PathBudget | None = None
        self._focus = Focus()
        self._region_reached = False
        """Whether a place inside the region of interest has been known to be reachable: until then what lies
        outside counts, so that a way is found."""

    def obey(self, directives: Directives, start_xy_m: Float[ndarray, " 2"]) -> None:
        """See `Planner`. What was given up is looked at again."""
        if directives.region != self._directives.region:
            self._region_reached = False
        if (directives.region, directives.no_go) != (self._directives.region, self._directives.no_go):
            self._zones = Zones(directives)
        self._directives = directives
        self._budget = PathBudget.of(directives, start_xy_m)
        self.partition.reopen_exhausted()

    def refuse(self, snapshot: MapSnapshot, x_m: float, y_m: float, yaw_rad: float) -> None:
        """See `Planner`."""
        self.memory.refuse(x_m, y_m, yaw_rad, observed=observed_around(snapshot.voxels, x_m, y_m))
        self.partition.reopen_exhausted()

    def adopt(self, snapshot: MapSnapshot, robot: RobotState, plan: Plan) -> None:
        """See `Planner`."""
        cycle = self.cycle(snapshot, robot)
        at = np.isfinite(plan.path.yaws_rad)
        places, yaws = plan.path.positions_m[at], plan.path.yaws_rad[at]
        views = self.scorer.score(cycle.snapshot, places, [-1] * len(places), cycle.observed_share)
        gains = [view.undiscounted_gain_at(float(yaw)) for view, yaw in zip(views, yaws, strict=True)]
        self.pursuit.follow(plan.path, np.array(gains), cycle.grid, robot.timestamp_s)

    def cycle(self, snapshot: MapSnapshot, robot: RobotState) -> PlanningCycle:
        """What the maps say now. Raises `PlanningError` on an empty voxel map."""
        voxels = snapshot.voxels
        if not voxels.states.size:
            raise PlanningError("the voxel map is empty: integrate a frame before planning")
        here = np.array([robot.x_m, robot.y_m])
        self._touches.notice(robot, self.context.robot)
        grid = self._floor.grid(
            voxels,
            snapshot.gaussians,
            robot_xy_m=here,
            touched_m=self._touches.points_m,
            forbidden=self._zones.forbidden(voxels),
        )
        car = None
        if isinstance(self.context.robot, AckermannConfig):
            pose = np.array([robot.x_m, robot.y_m, robot.yaw_rad])
            car = CarWays(grid, self.context.robot, self.config.kinodynamic, pose)
        self.scorer.car = car
        reach = reach_from(grid, here) if car is None else reach_from_cells(grid, here, *car.entries())
        is_place = reach.reachable & self._in_bounds(grid)
        if car is not None:
            is_place &= car.reach.anyhow
        inside = self._zones.inside(voxels)
        if inside is not None:
            self._region_reached |= bool((is_place & inside).any())
            if self._region_reached:
                is_place &= inside
        too_far = None
        if self._budget is not None:
            too_far = is_place & ~self._budget.affords(grid, reach, robot.path_length_m)
            is_place &= ~too_far
        self.memory.forget_refusals(lambda x_m, y_m: observed_around(voxels, x_m, y_m))
        focused = self._focused(snapshot)
        horizon = horizon_around(here, self._horizon_m, voxels)
        return PlanningCycle(
            snapshot=focused,
            whole=snapshot,
            robot=robot,
            grid=grid,
            reach=reach,
            is_place=is_place,
            too_far=too_far,
            horizon=horizon,
            missing=self.partition.update(focused.voxels),
            partition=self.partition,
            observed_share=voxels.observed_share(horizon),
            preferred_clearance_m=self.config.navigation.preferred_clearance_m,
            scorer=self.scorer,
            car=car,
        )

    def remember_views_taken(self, cycle: PlanningCycle) -> None:
        """Also how much of each view's gain is still promised now that it was taken."""
        robot = cycle.robot
        for x_m, y_m, yaw_rad, predicted in self.pursuit.views_taken_at(robot).tolist():
            place = np.array([[x_m, y_m]])
            (view,) = self.scorer.score(cycle.snapshot, place, [-1], cycle.observed_share)
            remaining = view.undiscounted_gain_at(yaw_rad) / max(predicted, 1e-9)
            self.memory.add(x_m, y_m, yaw_rad, remaining_share=remaining)
        self.memory.current = (robot.x_m, robot.y_m, robot.yaw_rad)

    def remember_no_way(self, views: list[View]) -> None:
        """A car found no way to these: they count as taken once, so that others come first."""
        for view in views:
            x_m, y_m = view.xy_m.tolist()
            self.memory.add(x_m, y_m, view.yaw_rad, remaining_share=0.0)

    def observed_share(self, snapshot: MapSnapshot, robot: RobotState) -> float:
        """lambda_o about the robot (HGS-Planner Eq. 10), without a whole survey."""
        here = np.array([robot.x_m, robot.y_m])
        return snapshot.voxels.observed_share(horizon_around(here, self._horizon_m, snapshot.voxels))

    def next_view(
        self, snapshot: MapSnapshot, robot: RobotState, path: Path, waypoints_passed: int
    ) -> tuple[View, float] | None:
        """The next view on the path as the newest maps see it, and its yaw; None where none is ahead."""
        ahead = np.flatnonzero(np.isfinite(path.yaws_rad[waypoints_passed:])) + waypoints_passed
        if not len(ahead):
            return None
        place, yaw = path.positions_m[ahead[0]], float(path.yaws_rad[ahead[0]])
        share = self.observed_share(snapshot, robot)
        (view,) = self.scorer.score(self._focused(snapshot), place[None], [-1], share)
        return view, yaw

    def panorama(self, snapshot: MapSnapshot, position_m: Float[ndarray, " 3"]) -> GainPanorama | None:
        """What would be gained at a place in each direction, where the gain in use can show it."""
        if not isinstance(self._evaluator, Panoramic) or not snapshot.voxels.states.size:
            return None
        return self._evaluator.panorama(self._focused(snapshot), position_m)

    def why_blocked(
        self, snapshot: MapSnapshot, robot: RobotState, path: Path, waypoints_passed: int
    ) -> str | None:
        """See `Pursuit.why_blocked`; no-go areas block, too."""
        forbidden = self._zones.forbidden(snapshot.voxels)
        return self.pursuit.why_blocked(snapshot, robot, path, waypoints_passed, forbidden=forbidden)

    def unseen(self, cycle: PlanningCycle) -> tuple[UnseenRegion, ...]:
        """What stays unseen if nothing more is done, and why."""
        places = cycle.grid.centres_m(np.flatnonzero(cycle.is_place))
        lost = []
        if cycle.too_far is not None:
            lost.append((UnseenReason.PATH_BUDGET, cycle.grid.centres_m(np.flatnonzero(cycle.too_far))))
        if self._directives.no_go:
            lost.append((UnseenReason.NO_GO, self._places_lost_to_no_go(cycle)))
        return unseen_regions(
            cycle.snapshot.voxels,
            self.partition,
            places,
            camera_range_m=self.context.camera_range_m,
            region=self.context.region,
            whole=cycle.whole.voxels,
            lost=lost,
        )

    def considered(
        self,
        *,
        selected: list[View],
        crossing: View | None = None,
        outranked: list[View],
        rejected: list[View],
        unreachable_m: list[Float[ndarray, " 2"]],
        threshold: float | None = None,
    ) -> tuple[Candidate, ...]:
        """Everything that a cycle considered, with what became of it and why; `threshold` is the total gain
        that a stop must be worth, where the planner has one."""
        z_m = self.context.camera_height_m
        candidates = [view.as_candidate(CandidateStatus.SELECTED, z_m) for view in selected]
        if crossing is not None:
            why = "on the way to what is farther off: passed, whatever it gains"
            candidates.append(crossing.as_candidate(CandidateStatus.CROSSING, z_m, why))
        for view in outranked:
            why = "worth a stop, but others come first"
            candidates.append(view.as_candidate(CandidateStatus.OUTRANKED, z_m, why))
        for view in rejected:
            why = self._why_rejected(view, threshold)
            candidates.append(view.as_candidate(CandidateStatus.BELOW_THRESHOLD, z_m, why))
        return (*candidates, *(Candidate.unreachable(middle, z_m) for middle in unreachable_m))

    def _why_rejected(self, view: View, threshold: float | None) -> str:
        if self.memory.is_refused(float(view.xy_m[0]), float(view.xy_m[1]), view.yaw_rad):
            return "rejected by the operator, and nothing around it has changed"
        undiscounted = float(np.max(view.undiscounted_by_yaw))
        needed = "too little for a stop" if threshold is None else f"less than the {threshold:.2f} of a stop"
        if threshold is not None and undiscounted >= threshold:
            return (
                f"gains {view.total_gain:.2f}, {needed}: {undiscounted:.2f} are promised, but views like it "
                "were taken, or refused, before"
            )
        return f"gains {view.total_gain:.2f}, {needed}"

    def why_nothing(self, cycle: PlanningCycle, unseen: tuple[UnseenRegion, ...], otherwise: str) -> str:
        """One sentence for an operator on why nothing is left; `otherwise` is the planner's own reason, for
        a robot that can move at all."""
        volume = sum(region.volume_m3 for region in unseen)
        left = (
            f"{len(unseen)} regions of {volume:.1f} m^3 together stay unseen"
            if unseen
            else "nothing is missing"
        )
        n_places = int(np.count_nonzero(cycle.is_place))
        if not n_places and cycle.too_far is not None and cycle.too_far.any():
            assert self._directives.max_path_m is not None
            left_m = self._directives.max_path_m - cycle.robot.path_length_m
            back = ", and back to its start" if self._directives.return_to_start else ""
            return f"the {left_m:.1f} m of path that are left lead to no further view{back}; {left}"
        if not n_places:
            radius = self.context.robot.radius_m
            return (
                "the robot cannot leave its place: no floor around it has been seen free with "
                f"{radius:.2f} m of room on every side (is something closer than that, or does no sensor see "
                f"the floor nearby?); {left}"
            )
        area = n_places * cycle.grid.size_m**2
        return f"{otherwise} (the robot can stand on {area:.1f} m^2 of floor); {left}"

    def state(self) -> dict[str, Any]:
        """Plain data; the partition's with it."""
        return {
            "partition": self.partition.state(),
            "memory": self.memory.state(),
            "pursuit": self.pursuit.state(),
            "touches": self._touches.state(),
            "region_reached": self._region_reached,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self.partition.restore(state["partition"])
        self.memory.restore(state["memory"])
        self.pursuit.restore(state["pursuit"])
        self._touches.restore(state["touches"])
        self._region_reached = bool(state["region_reached"])

    def _focused(self, snapshot: MapSnapshot) -> MapSnapshot:
        """The maps with only the region of interest worth seeing, once it has been reached."""
        inside = self._zones.inside(snapshot.voxels)
        if inside is None or not self._region_reached:
            return snapshot
        return self._focus.on(snapshot, inside)

    def _places_lost_to_no_go(self, cycle: PlanningCycle) -> Float[ndarray, "n 2"]:
        """Where views could be taken but for the no-go areas."""
        grid = build_navigation_grid(
            cycle.whole.voxels,
            self.config.navigation,
            self.context.robot,
            robot_xy_m=cycle.robot_xy_m,
            gaussians=cycle.whole.gaussians,
            touched_m=self._touches.points_m,
        )
        lost = reach_from(grid, cycle.robot_xy_m).reachable & ~cycle.reach.reachable & self._in_bounds(grid)
        inside = self._zones.inside(cycle.whole.voxels)
        if inside is not None and self._region_reached:
            lost &= inside
        return grid.centres_m(np.flatnonzero(lost))

    def _in_bounds(self, grid: NavigationGrid) -> Bool[ndarray, "nx ny"]:
        """Cells with centres inside the bounds of where viewpoints may be."""
        inside = np.ones(grid.shape, bool)
        region = self.context.region
        if region is None:
            return inside
        for axis, n in enumerate(grid.shape):
            centres = grid.lower_m[axis] + (np.arange(n) + 0.5) * grid.size_m
            along = (centres >= region.lower_m[axis]) & (centres < region.upper_m[axis])
            inside &= along[:, None] if axis == 0 else along[None, :]
        return inside
