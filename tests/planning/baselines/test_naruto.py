import numpy as np

from hgs_core.gain.uncertainty import UncertaintyGain
from hgs_core.planning.baselines.naruto import Naruto, NarutoConfig
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.planning.baselines.cycles import cycle_on
from tests.planning.closed_loop import context_in
from tests.planning.closed_world import CAMERA
from tests.planning.floors import room


def new(**config: object) -> tuple[Naruto, UncertaintyGain]:
    settings = NarutoConfig(**{"gain_threshold": 0.05, "last_gain_threshold": 0.05, **config})
    gain = UncertaintyGain(settings.gain, CAMERA)
    return Naruto(settings, gain, context_in(None)), gain


def two_gaps() -> VoxelMap:
    """A room of 9 m x 3 m: unseen in a corner 0.5 m wide at the left end, and all of the right end."""
    voxels = room(90, 30)
    voxels.states[1:6, 24:29, 1:] = VoxelState.UNOBSERVED
    voxels.states[80:89, 1:29, 1:] = VoxelState.UNOBSERVED
    voxels.note_change()
    return voxels


def cycle_at(voxels: VoxelMap, gain: UncertaintyGain, x_m: float, y_m: float) -> PlanningCycle:
    return cycle_on(voxels, gain, x_m, y_m)


def test_the_goal_sees_most_from_within_reach_whatever_the_way_to_it() -> None:
    """The robot stands beside the small gap; the large one is seen best from 0.5 to 2 m before it."""
    policy, gain = new()
    cycle = cycle_at(two_gaps(), gain, 1.55, 1.55)
    (goal,) = policy.choose(cycle, np.random.default_rng(0)).stops
    assert 8.0 - 2.0 <= goal.xy_m[0] <= 8.0 - 0.4
    assert abs(goal.yaw_near(0.0)) < np.radians(60.0)


def test_goals_lie_on_the_lattice() -> None:
    policy, gain = new()
    cycle = cycle_at(two_gaps(), gain, 1.55, 1.55)
    (goal,) = policy.choose(cycle, np.random.default_rng(0)).stops
    index = np.floor(goal.xy_m / 0.1).astype(int)
    assert np.all(index % 2 == 0)


def test_what_is_left_farther_away_is_looked_at_before_the_end() -> None:
    """Nothing within 2 m of a place: the right end of the room is behind a ditch that blocks the way."""
    voxels = two_gaps()
    voxels.states[1:6, 24:29, 1:] = VoxelState.FREE
    voxels.states[55:57, 1:29, 1:3] = VoxelState.OCCUPIED
    voxels.note_change()
    policy, gain = new()
    choice = policy.choose(cycle_at(voxels, gain, 1.55, 1.55), np.random.default_rng(0))
    assert choice.stops[0].xy_m[0] < 5.5
    assert "most of what is left" in choice.reason


def test_at_the_goal_it_looks_on_until_little_is_left_in_view() -> None:
    voxels = two_gaps()
    policy, gain = new(looks_per_goal=3)
    (goal,) = policy.choose(cycle_at(voxels, gain, 1.55, 1.55), np.random.default_rng(0)).stops
    cycle = cycle_at(voxels, gain, *goal.xy_m)
    for _ in range(2):
        again = policy.choose(cycle, np.random.default_rng(1))
        assert "looking on" in again.reason
        np.testing.assert_array_equal(again.stops[0].xy_m, goal.xy_m)
    after = policy.choose(cycle, np.random.default_rng(1))
    assert "looking on" not in after.reason


def test_a_goal_that_was_not_reached_is_given_up() -> None:
    voxels = two_gaps()
    policy, gain = new()
    policy.choose(cycle_at(voxels, gain, 1.55, 1.55), np.random.default_rng(0))
    again = policy.choose(cycle_at(voxels, gain, 3.05, 1.55), np.random.default_rng(1))
    assert "looking on" not in again.reason
    assert again.stops


def test_a_known_room_leaves_nothing() -> None:
    policy, gain = new()
    choice = policy.choose(cycle_at(room(60, 30), gain, 1.55, 1.55), np.random.default_rng(0))
    assert choice.stops == []
    assert "the best 0.00" in choice.reason
