"""Policies by name in closed worlds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hgs_core.gain.surface import SurfaceGainEvaluator
from hgs_core.gain.uncertainty import UncertaintyGain
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.baselines.gs_planner import GSPlanner, GSPlannerConfig
from hgs_core.planning.baselines.naruto import Naruto, NarutoConfig
from hgs_core.planning.baselines.random_views import RandomConfig, RandomViews
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.directives import Directives
from hgs_core.planning.gain_first import GainFirst, GainFirstConfig
from hgs_core.planning.hierarchical import HierarchicalPlanner
from hgs_core.planning.next_best_view import NextBestViewPlanner
from hgs_core.planning.plan import NothingLeft, Plan, Planner
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelState
from tests.planning.closed_loop import context_in
from tests.planning.closed_world import CAMERA, RANGE_M, ClosedWorld, CountingGain

START = (1.5, 1.2, 0.0)


def gs_planner(world: ClosedWorld) -> NextBestViewPlanner:
    config = GSPlannerConfig(gain_threshold=0.2)
    return NextBestViewPlanner(config, context_in(world.region), CountingGain(), GSPlanner(config))


def gain_first(world: ClosedWorld) -> NextBestViewPlanner:
    config, context = GainFirstConfig(gain_threshold=0.2), context_in(world.region)
    return NextBestViewPlanner(config, context, CountingGain(), GainFirst(config, context))


def random_views(world: ClosedWorld) -> NextBestViewPlanner:
    config = RandomConfig(gain_threshold=0.2)
    return NextBestViewPlanner(config, context_in(world.region), CountingGain(), RandomViews(config))


def naruto(world: ClosedWorld) -> NextBestViewPlanner:
    config = NarutoConfig(gain_threshold=0.1, last_gain_threshold=0.2)
    context = context_in(world.region)
    gain = UncertaintyGain(config.gain, CAMERA)
    return NextBestViewPlanner(config, context, gain, Naruto(config, gain, context))


def tare(world: ClosedWorld) -> Splatted:
    gain = GainConfig(method="surface")
    config = HierarchicalConfig(gain_threshold=1.0, gain=gain)
    evaluator = SurfaceGainEvaluator(gain, CAMERA, RANGE_M)
    return Splatted(HierarchicalPlanner(config, context_in(world.region), evaluator))


BASELINES: dict[str, Callable[[ClosedWorld], Planner]] = {
    "gs-planner": gs_planner,
    "random": random_views,
    "naruto": naruto,
    "tare": tare,
    "best": gain_first,
}


class Splatted:
    """A planner that is shown a well-learnt Gaussian in every occupied voxel; closed worlds have none."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner

    def plan(self, snapshot: MapSnapshot, robot: RobotState, rng: np.random.Generator) -> Plan | NothingLeft:
        return self._planner.plan(_splatted(snapshot), robot, rng)

    def should_replan(
        self, snapshot: MapSnapshot, robot: RobotState, plan: Plan, waypoints_passed: int
    ) -> str | None:
        return self._planner.should_replan(_splatted(snapshot), robot, plan, waypoints_passed)

    def unseen(self, snapshot: MapSnapshot, robot: RobotState) -> tuple:
        return self._planner.unseen(snapshot, robot)

    def obey(self, directives: Directives, start_xy_m: np.ndarray) -> None:
        self._planner.obey(directives, start_xy_m)

    def refuse(self, snapshot: MapSnapshot, x_m: float, y_m: float, yaw_rad: float) -> None:
        self._planner.refuse(_splatted(snapshot), x_m, y_m, yaw_rad)

    def adopt(self, snapshot: MapSnapshot, robot: RobotState, plan: Plan) -> None:
        self._planner.adopt(_splatted(snapshot), robot, plan)

    def state(self) -> dict:
        return self._planner.state()

    def restore(self, state: dict) -> None:
        self._planner.restore(state)


def _splatted(snapshot: MapSnapshot) -> MapSnapshot:
    voxels = snapshot.voxels
    centres = voxels.centres_m(np.argwhere(voxels.states == VoxelState.OCCUPIED))
    parameters = np.zeros((len(centres), 8), np.float32)
    parameters[:, :3] = centres
    parameters[:, 6] = np.log(0.02)
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    gaussians.information[: len(centres)] = 1e6
    return MapSnapshot(
        gaussians=gaussians, voxels=voxels, version=snapshot.version, timestamp_s=snapshot.timestamp_s
    )
