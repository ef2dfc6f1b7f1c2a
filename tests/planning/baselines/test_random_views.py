import numpy as np

from hgs_core.planning.baselines.random_views import RandomConfig, RandomViews
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.planning.baselines.cycles import GainByPlace, cycle_on
from tests.planning.closed_world import CountingGain
from tests.planning.floors import room


def half_seen_room() -> VoxelMap:
    voxels = room(60, 40)
    voxels.states[45:59, 1:39, 1:] = VoxelState.UNOBSERVED
    voxels.note_change()
    return voxels


def test_the_place_and_the_yaw_are_drawn_among_those_that_see_something() -> None:
    """What is missing lies to the right: every yaw that is drawn has some of it in its 90 degrees."""
    config, voxels = RandomConfig(gain_threshold=0.05), half_seen_room()
    stops = []
    for seed in range(12):
        cycle = cycle_on(voxels, CountingGain(), 0.75, 2.05)
        (stop,) = RandomViews(config).choose(cycle, np.random.default_rng(seed)).stops
        assert stop.total_gain >= 0.05
        assert stop.gain_at(stop.yaw_rad) == stop.total_gain
        assert stop.yaw_near(np.pi) == stop.yaw_rad, "no other yaw is left to choose"
        assert cycle.is_place.ravel()[stop.cell]
        stops.append((*stop.xy_m, stop.yaw_rad))
    assert len(set(stops)) > 8
    assert np.ptp([x for x, _, _ in stops]) > 1.5
    assert np.ptp([yaw for _, _, yaw in stops]) > 0.5


def test_the_gain_that_is_shown_is_that_of_the_drawn_yaw() -> None:
    cycle = cycle_on(half_seen_room(), CountingGain(), 0.75, 2.05)
    (stop,) = RandomViews(RandomConfig(gain_threshold=0.05)).choose(cycle, np.random.default_rng(3)).stops
    np.testing.assert_allclose(stop.coverage_gain, stop.undiscounted_gain_at(stop.yaw_rad))


def test_it_ends_when_no_place_sees_anything() -> None:
    cycle = cycle_on(half_seen_room(), GainByPlace(lambda x, y: 0.1), 0.75, 2.05)
    choice = RandomViews(RandomConfig(gain_threshold=0.2)).choose(cycle, np.random.default_rng(0))
    assert choice.stops == []
    assert len(choice.rejected) > 20
    assert "gains 0.20, the best 0.10" in choice.reason
