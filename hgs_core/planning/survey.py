"""What every planner knows of the world before it chooses: surveyed once a cycle, the same for all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.gain.viewpoint import GainEvaluator
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.floor_survey import FloorSurvey
from hgs_core.planning.low_obstacles import TouchMemory
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import reach_from
from hgs_core.planning.plan import UnseenRegion
from hgs_core.planning.pursuit import Pursuit
from hgs_core.planning.subspaces import SubspacePartition, horizon_around
from hgs_core.planning.unseen import unseen_regions
from hgs_core.planning.views import View, ViewMemory, ViewScorer
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
        self.memory = ViewMemory(config.memory)
        self.scorer = ViewScorer(evaluator, self.memory, context.camera_height_m)
        region = context.region
        origin = np.zeros(2) if region is None else np.array(region.lower_m[:2], dtype=np.float64)
        self.partition = SubspacePartition(config.subspaces, origin_m=origin)
        self._touches = TouchMemory()
        self.pursuit = Pursuit(config, context.robot, self._touches)
        self._floor = FloorSurvey(config.navigation, context.robot, sight_m=context.camera_range_m)
        self._horizon_m = horizon_m

    def cycle(self, snapshot: MapSnapshot, robot: RobotState) -> PlanningCycle:
        """What the maps say now. Raises `PlanningError` on an empty voxel map."""
        voxels = snapshot.voxels
        if not voxels.states.size:
            raise PlanningError("the voxel map is empty: integrate a frame before planning")
        here = np.array([robot.x_m, robot.y_m])
        self._touches.notice(robot, self.context.robot.radius_m)
        grid = self._floor.grid(voxels, snapshot.gaussians, robot_xy_m=here, touched_m=self._touches.points_m)
        reach = reach_from(grid, here)
        horizon = horizon_around(here, self._horizon_m, voxels)
        return PlanningCycle(
            snapshot=snapshot,
            robot=robot,
            grid=grid,
            reach=reach,
            is_place=reach.reachable & self._in_region(grid),
            horizon=horizon,
            missing=self.partition.update(voxels),
            partition=self.partition,
            observed_share=voxels.observed_share(horizon),
            preferred_clearance_m=self.config.navigation.preferred_clearance_m,
            scorer=self.scorer,
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
        (view,) = self.scorer.score(snapshot, place[None], [-1], share)
        return view, yaw

    def unseen(self, cycle: PlanningCycle) -> tuple[UnseenRegion, ...]:
        """What stays unseen if nothing more is done, and why."""
        return unseen_regions(
            cycle.snapshot.voxels,
            self.partition,
            cycle.grid.centres_m(np.flatnonzero(cycle.is_place)),
            camera_range_m=self.context.camera_range_m,
            region=self.context.region,
        )

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
        }

    def restore(self, state: dict[str, Any]) -> None:
        self.partition.restore(state["partition"])
        self.memory.restore(state["memory"])
        self.pursuit.restore(state["pursuit"])
        self._touches.restore(state["touches"])

    def _in_region(self, grid: NavigationGrid) -> Bool[ndarray, "nx ny"]:
        """Cells with centres inside the region."""
        inside = np.ones(grid.shape, bool)
        region = self.context.region
        if region is None:
            return inside
        for axis, n in enumerate(grid.shape):
            centres = grid.lower_m[axis] + (np.arange(n) + 0.5) * grid.size_m
            along = (centres >= region.lower_m[axis]) & (centres < region.upper_m[axis])
            inside &= along[:, None] if axis == 0 else along[None, :]
        return inside
