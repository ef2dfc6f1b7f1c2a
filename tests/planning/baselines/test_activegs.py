"""ActiveGS: unseen shares, confidence from views, utilities against ways."""

from dataclasses import replace

import numpy as np
import pytest

from hgs_core.gain.viewpoint import ViewGains
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.baselines.activegs import ActiveGsConfig, UtilityEvaluator, scores, voxel_confidence
from hgs_core.planning.plan import NothingLeft, Plan
from hgs_core.planning.registry import build_planner
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelState
from tests.gain.worlds import CAMERA, gaussians_at, snapshot_of
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
    return preset_mission("activegs", world)


def test_a_mission_ends_by_itself_in_every_room(world: ClosedWorld, mission: ClosedMission) -> None:
    assert_ends_having_seen_every_room(world, mission)


def test_the_same_seed_gives_the_same_trajectory(world: ClosedWorld, mission: ClosedMission) -> None:
    assert_same_trajectory("activegs", world, mission)


def test_a_restored_planner_goes_on_alike(world: ClosedWorld) -> None:
    assert_restored_goes_on_alike("activegs", world)


def test_scores_weigh_shares_of_utility_against_shares_of_the_way() -> None:
    """U = 3, 1 of 4; L = 4, 1 of 5: 0.75 - 0.5 * 0.8 and 0.25 - 0.5 * 0.2."""
    scored = scores(np.array([3.0, 1.0]), np.array([4.0, 1.0]), path_weight=0.5)
    np.testing.assert_allclose(scored, [0.35, 0.15])


def test_standing_at_every_candidate_costs_nothing() -> None:
    np.testing.assert_allclose(scores(np.array([1.0, 1.0]), np.zeros(2), path_weight=0.5), 0.5)


def wall_map(information: float) -> MapSnapshot:
    """A seen room; on its wall at x = 4.9 m four Gaussians a voxel, with so much information a channel."""
    voxels = room(50, 40)
    wall = np.argwhere(voxels.states == VoxelState.OCCUPIED)
    wall = wall[(wall[:, 2] > 0) & (wall[:, 0] == 49)]
    centres = np.repeat(voxels.centres_m(wall), 4, axis=0)
    return snapshot_of(voxels, gaussians_at(centres, information=information))


def test_confidence_counts_looks_head_on_from_half_the_range() -> None:
    """Such a look leaves (600 px * 0.1 m / 2.5 m)^2 = 576 of information on a voxel's face: four Gaussians of
    72 each make half a look, and of two looks that is a quarter."""
    confidence = voxel_confidence(wall_map(72.0), focal_px=600.0, range_m=5.0, confident_looks=2.0)
    assert confidence[49, 20, 7] == pytest.approx(0.25)
    assert confidence[20, 20, 7] == 1.0, "nothing there to be confident of"
    enough = voxel_confidence(wall_map(1e4), focal_px=600.0, range_m=5.0, confident_looks=2.0)
    assert enough[49, 20, 7] == 1.0


def utility_of(snapshot: MapSnapshot, config: ActiveGsConfig) -> ViewGains:
    evaluator = UtilityEvaluator(config, CAMERA, 5.0)
    return evaluator.evaluate(snapshot, np.array([[3.5, 2.0, 0.75]]), observed_share=1.0)


def test_the_unconfident_share_is_that_of_the_image() -> None:
    """The wall is 1.4 m away and reaches 0.1 to 1.5 m in height and 1.9 m to either side: its rows end at
    tan = 0.65 / 1.4 below and 0.75 / 1.4 above (the ceiling is open, the floor confident), of +-0.567."""
    config = ActiveGsConfig()
    gains = utility_of(wall_map(1.0), config)
    towards = int(np.argmin(np.abs(gains.yaws_rad)))
    expected = (0.65 / 1.4 + 0.75 / 1.4) / (2 * 340 / 600)
    assert gains.quality_by_yaw[0, towards] == pytest.approx(expected, abs=0.06)
    away = int(np.argmin(np.abs(np.abs(gains.yaws_rad) - np.pi)))
    assert gains.quality_by_yaw[0, away] == 0.0
    assert np.all(utility_of(wall_map(1e4), config).quality_by_yaw == 0.0)


def test_utility_adds_a_thousand_times_the_unseen_share() -> None:
    snapshot = wall_map(1.0)
    snapshot.voxels.states[:10] = VoxelState.UNOBSERVED
    snapshot.voxels.note_change()
    gains = utility_of(snapshot, ActiveGsConfig())
    everything_m3 = 50 * 40 * 15 * 1e-3
    np.testing.assert_allclose(
        gains.total_by_yaw, 1000.0 * gains.coverage_by_yaw / everything_m3 + gains.quality_by_yaw
    )
    assert gains.coverage_by_yaw.max() > 0.5


def test_a_seen_room_with_an_unconfident_wall_is_not_finished() -> None:
    planner = build_planner(ActiveGsConfig(), replace(context_in(None), camera=CAMERA, camera_range_m=5.0))
    at = RobotState(x_m=2.5, y_m=2.0, yaw_rad=np.pi, timestamp_s=0.0, path_length_m=0.0, collisions=0)
    plan = planner.plan(wall_map(1.0), at, np.random.default_rng(0))
    assert isinstance(plan, Plan)
    assert np.cos(plan.path.yaws_rad[-1]) > 0.5, "towards the wall"
    answer = planner.plan(wall_map(1e4), at, np.random.default_rng(0))
    assert isinstance(answer, NothingLeft)
    assert "unconfident" in answer.reason
