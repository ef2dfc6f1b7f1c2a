"""What every baseline is held to in the closed world, for the tests of each."""

from __future__ import annotations

import numpy as np

from hgs_core.config.presets import load_preset
from hgs_core.planning.plan import Planner
from hgs_core.planning.registry import build_planner, planner_config
from hgs_core.voxels.voxel_map import VoxelState
from tests.planning.closed_loop import ClosedMission, context_in, run_mission
from tests.planning.closed_world import ClosedWorld, PointRobot, new_voxels

START = (1.5, 1.2, 0.0)


def preset_planner(preset: str, world: ClosedWorld) -> Planner:
    return build_planner(planner_config(load_preset("planner", preset)), context_in(world.region))


def preset_mission(preset: str, world: ClosedWorld, *, max_plans: int = 150) -> ClosedMission:
    planner = preset_planner(preset, world)
    return run_mission(world, seed=0, start=START, planner=planner, max_plans=max_plans)


def assert_ends_having_seen_every_room(world: ClosedWorld, mission: ClosedMission) -> None:
    assert mission.answer is not None, f"still going after {len(mission.plans)} plans"
    trail = np.array(mission.robot.trail)
    wall_x, wall_y = world.wall_m
    assert np.any((trail[:, 0] > wall_x) & (trail[:, 1] < wall_y))
    assert np.any(trail[:, 1] > wall_y)
    free = ~world.solid[1:-1, 1:-1, 2:10]
    seen = mission.robot.voxels.states[1:-1, 1:-1, 2:10] == VoxelState.FREE
    assert np.count_nonzero(seen & free) > 0.95 * np.count_nonzero(free)
    assert mission.robot.length_m < 100.0


def assert_same_trajectory(preset: str, world: ClosedWorld, mission: ClosedMission) -> None:
    again = preset_mission(preset, world, max_plans=5)
    assert len(again.robot.trail) > 10
    assert again.robot.trail == mission.robot.trail[: len(again.robot.trail)]


def assert_restored_goes_on_alike(preset: str, world: ClosedWorld) -> None:
    """A planner restored in the middle of a mission ends it as the one that it was saved from."""
    robot = PointRobot(world, new_voxels(world), *START)
    for yaw in np.radians([0.0, 90.0, 180.0, 270.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
    first, second = preset_planner(preset, world), preset_planner(preset, world)
    plan = first.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    view = int(np.flatnonzero(np.isfinite(plan.path.yaws_rad))[0])
    robot.x_m, robot.y_m = (float(v) for v in plan.path.positions_m[view])
    robot.yaw_rad = float(plan.path.yaws_rad[view])
    robot.observe()
    second.restore(first.state())
    for seed in range(3):
        one = first.plan(robot.snapshot, robot.state, np.random.default_rng(seed))
        two = second.plan(robot.snapshot, robot.state, np.random.default_rng(seed))
        assert one.candidates == two.candidates
        assert one.reason == two.reason
        assert np.array_equal(one.path.positions_m, two.path.positions_m)
