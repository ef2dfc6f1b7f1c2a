"""What is asked of every baseline: it ends by itself, repeats itself, and goes on alike when restored."""

import numpy as np
import pytest

from hgs_core.config.presets import load_preset
from hgs_core.planning.plan import Plan, Planner, UnseenReason
from hgs_core.planning.registry import build_planner, planner_config
from tests.planning.baselines.worlds import BASELINES, START
from tests.planning.closed_loop import ClosedMission, context_in, run_mission
from tests.planning.closed_world import ClosedWorld, three_rooms

WORLD = three_rooms()
MISSIONS: dict[str, ClosedMission] = {}


def mission_of(name: str) -> ClosedMission:
    """One mission each, shared by the tests."""
    if name not in MISSIONS:
        MISSIONS[name] = run_mission(WORLD, seed=0, start=START, planner=BASELINES[name](WORLD))
    return MISSIONS[name]


@pytest.fixture(params=list(BASELINES))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_it_ends_by_itself_and_says_why(name: str) -> None:
    mission = mission_of(name)
    assert mission.answer is not None
    assert mission.answer.reason
    assert isinstance(BASELINES[name](WORLD), Planner)


def test_every_room_is_entered_and_little_stays_missing(name: str) -> None:
    mission = mission_of(name)
    trail = np.array(mission.robot.trail)
    wall_x, wall_y = WORLD.wall_m
    assert np.any((trail[:, 0] > wall_x) & (trail[:, 1] < wall_y))
    assert np.any(trail[:, 1] > wall_y)
    assert np.count_nonzero(mission.robot.voxels.missing()) * 1e-3 < 1.0


def test_nothing_is_left_that_should_have_been_visited(name: str) -> None:
    answer = mission_of(name).answer
    assert answer is not None
    assert all(region.reason is not UnseenReason.INTERRUPTED for region in answer.unseen)
    assert sum(region.volume_m3 for region in answer.unseen) < 2.0


def test_the_robot_touches_nothing(name: str) -> None:
    for x_m, y_m, _ in mission_of(name).robot.trail:
        assert WORLD.distance_to_solid_m(x_m, y_m) >= 0.25 - 0.05


def test_the_same_seed_gives_the_same_trajectory(name: str) -> None:
    again = run_mission(WORLD, seed=0, start=START, planner=BASELINES[name](WORLD), max_plans=5)
    assert len(again.robot.trail) > 10
    assert again.robot.trail == mission_of(name).robot.trail[: len(again.robot.trail)]


def test_a_restored_planner_goes_on_alike(name: str) -> None:
    world: ClosedWorld = WORLD
    first, second = BASELINES[name](world), BASELINES[name](world)
    robot = run_mission(world, seed=0, start=START, planner=first, max_plans=4).robot
    second.restore(first.state())
    one, two = (p.plan(robot.snapshot, robot.state, np.random.default_rng(1)) for p in (first, second))
    assert isinstance(one, Plan)
    assert isinstance(two, Plan)
    assert np.array_equal(one.path.positions_m, two.path.positions_m)
    assert np.array_equal(one.path.yaws_rad, two.path.yaws_rad, equal_nan=True)
    assert one.candidates == two.candidates
    assert one.reason == two.reason


def test_its_preset_builds_it(name: str) -> None:
    config = planner_config(load_preset("planner", name))
    assert config.method == {"tare": "hierarchical", "best": "gain-first"}.get(name, name)
    assert config.gain.method == ("surface" if name == "tare" else "panorama")
    assert isinstance(build_planner(config, context_in(WORLD.region)), Planner)
