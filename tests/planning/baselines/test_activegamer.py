"""ActiveGAMER: holes as shares of the image, the coarse pool, the fine one, the end."""

import numpy as np
import pytest

from hgs_core.gain.viewpoint import GainConfig
from hgs_core.planning.baselines.activegamer import HoleEvaluator, preference
from tests.gain.test_evaluator import half_unseen_room
from tests.gain.worlds import CAMERA, snapshot_of
from tests.planning.baselines.behaviour import (
    assert_ends_having_seen_every_room,
    assert_restored_goes_on_alike,
    assert_same_trajectory,
    preset_mission,
)
from tests.planning.closed_loop import ClosedMission
from tests.planning.closed_world import ClosedWorld, three_rooms


@pytest.fixture(scope="module")
def world() -> ClosedWorld:
    return three_rooms()


@pytest.fixture(scope="module")
def mission(world: ClosedWorld) -> ClosedMission:
    return preset_mission("activegamer", world)


def test_a_mission_ends_by_itself_in_every_room(world: ClosedWorld, mission: ClosedMission) -> None:
    assert_ends_having_seen_every_room(world, mission)


def test_the_same_seed_gives_the_same_trajectory(world: ClosedWorld, mission: ClosedMission) -> None:
    assert_same_trajectory("activegamer", world, mission)


def test_a_restored_planner_goes_on_alike(world: ClosedWorld) -> None:
    assert_restored_goes_on_alike("activegamer", world)


def test_the_share_of_holes_is_that_of_the_image() -> None:
    """The half room beyond x = 2.5 m is unseen: looking at it, every pixel has a hole; away from it, none."""
    voxels = half_unseen_room()
    evaluator = HoleEvaluator(GainConfig(), CAMERA, 5.0)
    gains = evaluator.evaluate(snapshot_of(voxels), np.array([[1.5, 2.0, 1.25]]), observed_share=0.5)
    assert gains.total_by_yaw[0, np.argmin(np.abs(gains.yaws_rad))] == pytest.approx(1.0, abs=0.02)
    assert gains.total_by_yaw[0, np.argmin(np.abs(np.abs(gains.yaws_rad) - np.pi))] == 0.0
    # Towards +y the border runs along the view, 1.0 m to the right, and a wall ends it 1.1 m ahead: columns
    # beyond tan = 1.0 / 1.1 cross the border first, of columns between tan = -1 and 1.
    aside = gains.total_by_yaw[0, np.argmin(np.abs(gains.yaws_rad - np.pi / 2))]
    assert aside == pytest.approx((1.0 - 1.0 / 1.1) / 2.0, abs=0.01)


def test_a_far_view_needs_e_times_the_holes_for_each_unit_of_distance() -> None:
    worth = preference(np.array([0.1, 0.1 * np.e, 0.2]), np.array([0.0, 1.0, 1.0]))
    assert worth[0] == pytest.approx(worth[1])
    assert worth[2] < worth[0]


def test_the_coarse_pool_comes_first_and_the_fine_one_is_the_last(mission: ClosedMission) -> None:
    stages = [plan.reason[: len("stage 1")] for plan in mission.plans]
    assert stages[0] == "stage 1"
    assert stages[-1] == "stage 2"
    assert stages == sorted(stages)


def test_candidates_look_in_the_stages_directions(mission: ClosedMission) -> None:
    """5 and 15 yaws, evenly spread."""
    yaws = np.array([c.yaw_rad for c in mission.plans[0].candidates])
    assert len(np.unique(np.round(yaws, 6))) <= 5
    apart = (yaws - yaws[0]) / (2 * np.pi / 5)
    np.testing.assert_allclose(apart, np.round(apart), atol=1e-6)
