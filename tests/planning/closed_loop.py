"""Drives a planner through a closed world until it says that nothing is left."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hgs_core.geometry.boxes import Box
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.hierarchical import HierarchicalPlanner
from hgs_core.planning.plan import NothingLeft, Plan, Planner
from hgs_core.planning.survey import PlannerContext
from hgs_core.robot.differential import DifferentialConfig
from tests.planning.closed_world import (
    CAMERA,
    CAMERA_HEIGHT_M,
    RANGE_M,
    ClosedWorld,
    CountingGain,
    PointRobot,
    new_voxels,
)

GAIN_THRESHOLD_M3 = 0.2
"""The counting gain is in cubic metres."""


@dataclass
class ClosedMission:
    robot: PointRobot
    plans: list[Plan] = field(default_factory=list)
    views: list[tuple[float, float, float]] = field(default_factory=list)
    replan_reasons: list[str] = field(default_factory=list)
    replan_s: list[float] = field(default_factory=list)
    answer: NothingLeft | None = None


def context_in(region: Box | None) -> PlannerContext:
    """What a planner is told of the robot that drives here."""
    return PlannerContext(
        robot=DifferentialConfig(),
        camera=CAMERA,
        camera_height_m=CAMERA_HEIGHT_M,
        camera_range_m=RANGE_M,
        region=region,
    )


def new_planner(world: ClosedWorld, config: HierarchicalConfig | None = None) -> HierarchicalPlanner:
    config = config or HierarchicalConfig(gain_threshold=GAIN_THRESHOLD_M3)
    return HierarchicalPlanner(config, context_in(world.region), CountingGain())


def run_mission(
    world: ClosedWorld,
    *,
    seed: int,
    start: tuple[float, float, float],
    planner: Planner | None = None,
    max_plans: int = 150,
    on_plan: Callable[[PointRobot, Plan], None] | None = None,
) -> ClosedMission:
    robot = PointRobot(world, new_voxels(world), *start)
    planner = planner or new_planner(world)
    rng = np.random.default_rng(seed)
    mission = ClosedMission(robot)
    for yaw in start[2] + np.radians([0.0, 90.0, 180.0, 270.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
    while len(mission.plans) < max_plans:
        answer = planner.plan(robot.snapshot, robot.state, rng)
        if isinstance(answer, NothingLeft):
            mission.answer = answer
            break
        mission.plans.append(answer)
        if on_plan is not None:
            on_plan(robot, answer)
        _drive(robot, planner, answer, mission)
    return mission


def _drive(robot: PointRobot, planner: Planner, plan: Plan, mission: ClosedMission) -> None:
    """Until the next view is taken, the path ends, or the planner wants to plan again."""
    for passed, ((x_m, y_m), yaw) in enumerate(zip(plan.path.positions_m, plan.path.yaws_rad, strict=True)):
        for arrived in robot.moves_to(x_m, y_m, yaw):
            robot.observe()
            taken = bool(np.isfinite(yaw)) and arrived
            if taken:
                mission.views.append((robot.x_m, robot.y_m, robot.yaw_rad))
                return
            began = time.perf_counter()
            reason = planner.should_replan(robot.snapshot, robot.state, plan, passed)
            mission.replan_s.append(time.perf_counter() - began)
            if reason is not None:
                mission.replan_reasons.append(reason)
                return
