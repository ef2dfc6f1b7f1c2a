"""The planner with no simulator behind it: voxel maps, a counting gain, a point robot. No ground truth."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hgs_core.errors import PlanningError
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.global_planner import GlobalConfig
from hgs_core.planning.hierarchical import HierarchicalPlanner
from hgs_core.planning.plan import CandidateStatus, NothingLeft, Plan, Planner, UnseenReason
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.robot import RobotConfig
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.planning.closed_loop import (
    GAIN_THRESHOLD_M3,
    ClosedMission,
    context_in,
    new_planner,
    run_mission,
)
from tests.planning.closed_world import ClosedWorld, CountingGain, PointRobot, new_voxels, three_rooms
from tests.planning.floors import empty_map, room

START = (1.5, 1.2, 0.0)


@pytest.fixture(scope="module")
def world() -> ClosedWorld:
    return three_rooms()


@pytest.fixture(scope="module")
def mission(world: ClosedWorld) -> ClosedMission:
    return run_mission(world, seed=0, start=START)


def test_a_mission_ends_by_itself_and_says_why(mission: ClosedMission) -> None:
    assert mission.answer is not None
    assert "no reachable view gains" in mission.answer.reason
    assert all(region.reason is not UnseenReason.INTERRUPTED for region in mission.answer.unseen)
    assert mission.robot.length_m < 80.0


def test_every_room_is_entered_and_seen(world: ClosedWorld, mission: ClosedMission) -> None:
    trail = np.array(mission.robot.trail)
    wall_x, wall_y = world.wall_m
    assert np.any((trail[:, 0] > wall_x) & (trail[:, 1] < wall_y))
    assert np.any(trail[:, 1] > wall_y)
    missing = np.count_nonzero(mission.robot.voxels.missing()) * 1e-3
    assert missing < 0.6
    free = ~world.solid[1:-1, 1:-1, 2:10]
    seen = mission.robot.voxels.states[1:-1, 1:-1, 2:10] == VoxelState.FREE
    assert np.count_nonzero(seen & free) > 0.95 * np.count_nonzero(free)


def test_the_robot_touches_nothing(world: ClosedWorld, mission: ClosedMission) -> None:
    trail = np.array(mission.robot.trail)
    for a, b in pairwise(trail):
        for share in (0.0, 0.5, 1.0):
            x_m, y_m = a[:2] + share * (b[:2] - a[:2])
            assert world.distance_to_solid_m(x_m, y_m) >= 0.25 - 0.05, (x_m, y_m)


def test_a_tour_that_knows_one_goal_at_a_time_still_leads_everywhere(world: ClosedWorld) -> None:
    config = HierarchicalConfig(gain_threshold=GAIN_THRESHOLD_M3, global_level=GlobalConfig(max_goals=1))
    mission = run_mission(world, seed=0, start=START, planner=new_planner(world, config))
    assert mission.answer is not None
    assert np.count_nonzero(mission.robot.voxels.missing()) * 1e-3 < 0.6


def test_plans_explain_themselves(mission: ClosedMission) -> None:
    for plan in mission.plans:
        assert len(plan.path.positions_m) >= 1
        assert np.isfinite(plan.path.yaws_rad).any()
        statuses = {candidate.status for candidate in plan.candidates}
        assert CandidateStatus.SELECTED in statuses
        for candidate in plan.candidates:
            if candidate.status is CandidateStatus.BELOW_THRESHOLD:
                assert candidate.total_gain < GAIN_THRESHOLD_M3
        assert plan.reason
        assert plan.times.total_s > 0
        assert plan.horizon.size_m[:2].tolist() == pytest.approx([6.0, 6.0])
    assert any(plan.global_tour_m.shape[0] > 1 for plan in mission.plans)


def test_the_same_seed_gives_the_same_trajectory(world: ClosedWorld, mission: ClosedMission) -> None:
    again = run_mission(world, seed=0, start=START, max_plans=6)
    n = len(again.robot.trail)
    assert again.robot.trail == mission.robot.trail[:n]


def test_a_restored_planner_goes_on_alike(world: ClosedWorld) -> None:
    robot = PointRobot(world, new_voxels(world), *START)
    for yaw in np.radians([0.0, 90.0, 180.0, 270.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
    first, second = new_planner(world), new_planner(world)
    rng = np.random.default_rng(0)
    first.plan(robot.snapshot, robot.state, rng)
    second.restore(first.state())
    one = first.plan(robot.snapshot, robot.state, np.random.default_rng(1))
    two = second.plan(robot.snapshot, robot.state, np.random.default_rng(1))
    assert isinstance(one, Plan)
    assert isinstance(two, Plan)
    assert np.array_equal(one.path.positions_m, two.path.positions_m)
    assert np.array_equal(one.path.yaws_rad, two.path.yaws_rad, equal_nan=True)
    assert one.candidates == two.candidates
    assert one.subspaces == two.subspaces


def planner_on(voxels: VoxelMap, x_m: float, y_m: float) -> tuple[HierarchicalPlanner, PointRobot]:
    planner = HierarchicalPlanner(HierarchicalConfig(), context_in(None), CountingGain())
    return planner, PointRobot(ClosedWorld(np.zeros((1, 1, 1), bool)), voxels, x_m, y_m, 0.0)


def test_it_is_a_planner() -> None:
    planner, _ = planner_on(room(30, 30), 1.5, 1.5)
    assert isinstance(planner, Planner)


def test_a_finished_room_leaves_nothing() -> None:
    planner, robot = planner_on(room(30, 30), 1.5, 1.5)
    answer = planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert isinstance(answer, NothingLeft)
    assert answer.unseen == ()
    assert "nothing is missing" in answer.reason


def test_a_robot_that_cannot_move_says_so() -> None:
    planner, robot = planner_on(empty_map(30, 30), 1.5, 1.5)
    answer = planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert isinstance(answer, NothingLeft)
    assert planner.unseen(robot.snapshot, robot.state) == ()


def test_an_empty_map_is_an_error() -> None:
    planner, robot = planner_on(empty_map(30, 30), 1.5, 1.5)
    robot.voxels = VoxelMap(robot.voxels.config)
    with pytest.raises(PlanningError, match="integrate a frame"):
        planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert planner.unseen(robot.snapshot, robot.state) == ()


def half_seen_room() -> VoxelMap:
    voxels = room(60, 40)
    voxels.states[45:59, 1:39, 1:] = VoxelState.UNOBSERVED
    voxels.note_change()
    return voxels


def test_a_blocked_path_is_reported_and_a_clear_one_is_not() -> None:
    planner, robot = planner_on(half_seen_room(), 0.75, 2.05)
    plan = planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert isinstance(plan, Plan)
    assert planner.should_replan(robot.snapshot, robot.state, plan, 0) is None
    moving = np.flatnonzero(np.linalg.norm(plan.path.positions_m - plan.path.positions_m[0], axis=1) > 0.6)
    assert len(moving), "the plan must lead somewhere for this test"
    before = plan.path.positions_m[moving[0] - 1]
    middle = (before + plan.path.positions_m[moving[0]]) / 2
    i, j = (int(v) for v in np.floor(middle / 0.1))
    passed = int(np.flatnonzero(np.isfinite(plan.path.yaws_rad[: moving[0]]))[-1:].sum()) + 1
    robot.x_m, robot.y_m = (float(v) for v in before)
    robot.voxels.states[i, j, 1:5] = VoxelState.OCCUPIED
    robot.voxels.note_change()
    reason = planner.should_replan(robot.snapshot, robot.state, plan, min(passed, int(moving[0])))
    assert reason is not None
    assert reason.startswith("blocked")


def test_a_view_that_lost_its_gain_is_reported_once_a_second() -> None:
    planner, robot = planner_on(half_seen_room(), 0.75, 2.05)
    plan = planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert isinstance(plan, Plan)
    robot.voxels.states[45:59, 1:39, 1:] = VoxelState.FREE
    robot.voxels.note_change()
    assert planner.should_replan(robot.snapshot, robot.state, plan, 0) is None  # looked at just now
    robot.time_s += 1.0
    reason = planner.should_replan(robot.snapshot, robot.state, plan, 0)
    assert reason is not None
    assert reason.startswith("target already seen")


@pytest.mark.parametrize("vehicle", [DifferentialConfig(), AckermannConfig()], ids=["wheeled", "car"])
def test_what_was_seen_on_the_way_is_not_proposed_again(vehicle: RobotConfig) -> None:
    """A car's way ends beside its goal by rounding: its subspace's view must be forgotten all the same."""
    context = replace(context_in(None), robot=vehicle)
    planner = HierarchicalPlanner(HierarchicalConfig(), context, CountingGain())
    _, robot = planner_on(half_seen_room(), 0.95, 2.05)
    plan = planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert isinstance(plan, Plan)
    end_m = plan.path.positions_m[np.flatnonzero(np.isfinite(plan.path.yaws_rad))[0]]

    def away_m() -> list[float]:
        return [
            float(np.hypot(*(entry["view"]["xy_m"] - end_m))) for entry in planner.state()["global"]["views"]
        ]

    assert min(away_m()) < 0.01, "the plan must lead to a subspace's view for this test"
    robot.voxels.states[45:59, 1:39, 1:] = VoxelState.FREE
    robot.voxels.note_change()
    robot.time_s += 1.0
    assert "already seen" in (planner.should_replan(robot.snapshot, robot.state, plan, 0) or "")
    assert min(away_m(), default=np.inf) > 0.01


def test_a_gain_that_never_drops_does_not_hold_the_robot_for_ever() -> None:
    """Something that the evaluator believes visible and no view ever shows: a mission must still end."""
    voxels = half_seen_room()
    planner, robot = planner_on(voxels, 0.75, 2.05)
    rng = np.random.default_rng(0)
    for _ in range(60):
        plan = planner.plan(robot.snapshot, robot.state, rng)
        if isinstance(plan, NothingLeft):
            break
        view = int(np.flatnonzero(np.isfinite(plan.path.yaws_rad))[0])
        robot.x_m, robot.y_m = (float(v) for v in plan.path.positions_m[view])
        robot.yaw_rad = float(plan.path.yaws_rad[view])
    assert isinstance(plan, NothingLeft)
