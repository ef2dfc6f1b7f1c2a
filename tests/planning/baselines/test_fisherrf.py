"""FisherRF: information along paths, frontiers first, then what is least certain."""

import numpy as np
import pytest

from hgs_core.planning.baselines.fisherrf import FisherRfConfig, information_per_metre
from hgs_core.planning.plan import Plan
from hgs_core.planning.registry import build_planner
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelState
from tests.gain.worlds import gaussians_at, snapshot_of
from tests.planning.baselines.behaviour import (
    assert_ends_having_seen_every_room,
    assert_restored_goes_on_alike,
    assert_same_trajectory,
    preset_mission,
)
from tests.planning.closed_loop import ClosedMission, context_in
from tests.planning.closed_world import ClosedWorld, three_rooms
from tests.planning.floors import room


@pytest.fixture(scope="module")
def world() -> ClosedWorld:
    return three_rooms()


@pytest.fixture(scope="module")
def mission(world: ClosedWorld) -> ClosedMission:
    return preset_mission("fisherrf", world)


def test_a_mission_ends_by_itself_in_every_room(world: ClosedWorld, mission: ClosedMission) -> None:
    assert_ends_having_seen_every_room(world, mission)


def test_the_same_seed_gives_the_same_trajectory(world: ClosedWorld, mission: ClosedMission) -> None:
    assert_same_trajectory("fisherrf", world, mission)


def test_a_restored_planner_goes_on_alike(world: ClosedWorld) -> None:
    assert_restored_goes_on_alike("fisherrf", world)


def test_information_is_that_of_the_goal_and_of_the_way_over_its_length() -> None:
    """Goal 2, on the way 0.3 and 5 (cut to a half of the goal's): 2 + 0.3 + 1 over 4 + 1 metres."""
    worth = information_per_metre(2.0, np.array([0.3, 5.0]), 4.0, share_of_goal=0.5, base_length_m=1.0)
    assert worth == pytest.approx(3.3 / 5.0)


def test_of_two_ways_to_as_good_a_goal_the_more_informative_wins() -> None:
    plain, richer = (
        information_per_metre(1.0, np.array(on_way), 3.0, share_of_goal=0.5, base_length_m=1.0)
        for on_way in ([0.0, 0.1], [0.3, 0.1])
    )
    assert richer > plain


def test_goals_stand_at_frontiers_as_long_as_there_are_any(mission: ClosedMission) -> None:
    assert "to a frontier" in mission.plans[0].reason
    assert mission.answer is not None
    assert "no frontier is left" in mission.answer.reason


def test_without_frontiers_the_least_certain_part_of_the_map_is_looked_at(world: ClosedWorld) -> None:
    """A closed room, all seen; one of its walls was hardly looked at."""
    voxels = room(50, 40)
    wall = np.argwhere(voxels.states == VoxelState.OCCUPIED)
    wall = wall[(wall[:, 2] > 2) & ((wall[:, 0] == 49) | (wall[:, 0] == 0))]
    centres = voxels.centres_m(wall)
    gaussians = gaussians_at(np.repeat(centres, 4, axis=0), information=1e5, radius_m=0.03)
    gaussians.information[gaussians.size // 2 :] = 0.1  # x = 4.95 m: the second half of the rows
    planner = build_planner(FisherRfConfig(information_threshold=0.01), context_in(None))
    at = RobotState(x_m=2.5, y_m=2.0, yaw_rad=np.pi, timestamp_s=0.0, path_length_m=0.0, collisions=0)
    plan = planner.plan(snapshot_of(voxels, gaussians), at, np.random.default_rng(0))
    assert isinstance(plan, Plan)
    assert "least certain" in plan.reason
    x_m, yaw_rad = plan.path.positions_m[-1][0], plan.path.yaws_rad[-1]
    assert np.cos(yaw_rad) * (4.95 - x_m) > 0.5, "towards the wall that is uncertain"
