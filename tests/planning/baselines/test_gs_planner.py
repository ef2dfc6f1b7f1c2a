import numpy as np
import pytest

from hgs_core.planning.baselines.gs_planner import GSPlanner, GSPlannerConfig
from tests.planning.baselines.cycles import GainByPlace, cycle_on
from tests.planning.floors import room

RNG = np.random.default_rng


def choose(policy: GSPlanner, gain: GainByPlace, x_m: float, y_m: float, *, nx: int = 120):
    """In a room of `nx` by 30 voxels."""
    return policy.choose(cycle_on(room(nx, 30), gain, x_m, y_m), RNG(0))


def test_the_utility_is_the_gain_less_the_farther_the_way() -> None:
    """All views gain 1: the one to be had by turning in place costs nothing, so it is the best."""
    policy = GSPlanner(GSPlannerConfig())
    choice = choose(policy, GainByPlace(lambda x, y: 1.0), 1.5, 1.5)
    (stop,) = choice.stops
    np.testing.assert_array_equal(stop.xy_m, [1.5, 1.5])


@pytest.mark.parametrize(("discount", "goes_far"), [(0.1, True), (2.0, False)])
def test_a_greater_gain_farther_away_is_weighed_against_the_way(discount: float, goes_far: bool) -> None:
    """1 here, 3 beyond 2 m: exp(-0.1 d) of 3 is more than 1 at every d within 3 m, exp(-2 d) less."""
    policy = GSPlanner(GSPlannerConfig(path_discount_per_m=discount))
    choice = choose(policy, GainByPlace(lambda x, y: 3.0 if x > 3.5 else 1.0), 1.5, 1.5)
    assert (choice.stops[0].xy_m[0] > 3.5) == goes_far


def test_ten_views_a_step_suffice_while_one_is_worth_a_visit() -> None:
    gain = GainByPlace(lambda x, y: 1.0)
    choose(GSPlanner(GSPlannerConfig()), gain, 6.0, 1.5)
    assert sum(gain.batches) <= 10


def test_views_left_for_later_are_visited_when_nothing_nearby_is_worth_it() -> None:
    """Something at the left end of a long room is passed over for more on the right; then, from far away on
    the right, where nothing is left, it is remembered."""
    policy = GSPlanner(GSPlannerConfig(path_discount_per_m=0.0))
    first = choose(policy, GainByPlace(lambda x, y: 2.0 if x > 3.0 else 1.0), 3.0, 1.5)
    assert first.stops[0].xy_m[0] > 3.0
    library = policy.state()["library"]
    assert np.count_nonzero(library[:, 0] <= 3.0) >= 1
    gain = GainByPlace(lambda x, y: 1.0 if x <= 3.0 else 0.0)
    later = choose(policy, gain, 10.5, 1.5)
    assert "left for later" in later.reason
    assert later.stops[0].xy_m[0] <= 3.0
    assert max(gain.batches) <= 10


def test_views_of_the_library_that_lost_their_gain_leave_it() -> None:
    policy = GSPlanner(GSPlannerConfig())
    choose(policy, GainByPlace(lambda x, y: 1.0), 3.0, 1.5)
    assert len(policy.state()["library"]) > 2
    choice = choose(policy, GainByPlace(lambda x, y: 0.0), 3.0, 1.5)
    assert choice.stops == []
    assert len(policy.state()["library"]) == 0


def test_before_the_end_the_whole_map_is_looked_at() -> None:
    """Only the far end gains anything, and nothing has led there."""
    gain = GainByPlace(lambda x, y: 1.0 if x > 10.5 else 0.0)
    choice = choose(GSPlanner(GSPlannerConfig()), gain, 1.5, 1.5)
    assert choice.stops[0].xy_m[0] > 10.5
    assert "all over the map" in choice.reason
    assert max(gain.batches) <= 10


def test_nothing_left_names_the_threshold_and_the_best() -> None:
    choice = choose(GSPlanner(GSPlannerConfig(gain_threshold=0.5)), GainByPlace(lambda x, y: 0.4), 1.5, 1.5)
    assert choice.stops == []
    assert "gains 0.50, the best 0.40" in choice.reason
    assert all(view.total_gain < 0.5 for view in choice.rejected)
