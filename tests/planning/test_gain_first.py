"""What `best` makes of gains that are known by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hgs_core.gain.viewpoint import SurfaceInView
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.gain_first import GainFirst, GainFirstConfig
from hgs_core.planning.next_best_view import Choice
from tests.planning.baselines.cycles import GainByPlace, cycle_on
from tests.planning.closed_loop import context_in
from tests.planning.floors import room

GainAt = Callable[[float, float], float]


class LocatedGain(GainByPlace):
    """All surface lies behind cubes given by place."""

    def __init__(self, gain_at: GainAt, cube_at: Callable[[float, float], int]) -> None:
        super().__init__(gain_at)
        self.cube_at = cube_at

    def new_surface_in_view(
        self, snapshot: MapSnapshot, positions_m: np.ndarray, yaws_rad: np.ndarray
    ) -> list[SurfaceInView]:
        return [
            SurfaceInView(
                cubes=np.array([self.cube_at(x, y)], np.int64), area_m2=np.array([self.gain_at(x, y)])
            )
            for x, y, _ in positions_m
        ]


def policy_of(**settings: float) -> GainFirst:
    return GainFirst(GainFirstConfig(gain_threshold=0.4, **settings), context_in(None))


def choose(policy: GainFirst, gain: GainByPlace, x_m: float, y_m: float) -> Choice:
    """In a room of 12 m by 3 m."""
    return policy.choose(cycle_on(room(120, 30), gain, x_m, y_m), np.random.default_rng(0))


def test_a_room_that_every_place_shows_takes_one_stop() -> None:
    choice = choose(policy_of(), LocatedGain(lambda x, y: 1.0, lambda x, y: 7), 1.5, 1.5)
    (stop,) = choice.stops
    np.testing.assert_array_equal(stop.xy_m, [1.5, 1.5])


def test_what_lies_behind_other_cubes_takes_a_stop_of_its_own() -> None:
    """Places beyond 3 m show one thing, those before it another."""
    choice = choose(policy_of(), LocatedGain(lambda x, y: 1.0, lambda x, y: int(x > 3.0)), 1.5, 1.5)
    assert [stop.xy_m[0] > 3.0 for stop in choice.stops] == [False, True]


def test_little_gain_is_taken_along_but_not_driven_to() -> None:
    """0.2 is more than a glance must be worth (0.1), less than a stop 3 m away must be (0.4)."""

    def here(x: float, y: float) -> float:
        return 0.2 if x < 2.0 else 0.0

    assert len(choose(policy_of(), LocatedGain(here, lambda x, y: 7), 1.5, 1.5).stops) == 1
    assert not choose(policy_of(), LocatedGain(here, lambda x, y: 7), 4.9, 1.5).stops


def test_less_is_enough_once_nothing_gains_what_a_stop_must_be_worth() -> None:
    """0.3 is less than the 0.4 of a stop, more than half of it: taken after all else, and from then on."""
    cube = lambda x, y: int(x > 6.0)  # noqa: E731
    first = LocatedGain(lambda x, y: 1.0 if x < 3.5 else 0.3 if x > 7.0 else 0.0, cube)
    later = LocatedGain(lambda x, y: 0.3 if x > 7.0 else 0.0, cube)
    assert not choose(policy_of(), later, 4.5, 1.5).stops
    policy = policy_of(last_share=0.5)
    before = choose(policy, first, 5.0, 1.5)
    assert all(stop.xy_m[0] < 3.5 for stop in before.stops)
    assert before.threshold == pytest.approx(0.4)
    after = choose(policy, later, 4.5, 1.5)
    assert [stop.xy_m[0] > 7.0 for stop in after.stops] == [True]
    assert after.threshold == pytest.approx(0.2)
    restored = policy_of(last_share=0.5)
    restored.restore(policy.state())
    assert choose(restored, first, 5.0, 1.5).threshold == pytest.approx(0.2)
    restored.reconsider()
    assert choose(restored, first, 5.0, 1.5).threshold == pytest.approx(0.4)


def test_a_great_gain_far_away_comes_before_a_small_one_on_the_other_side() -> None:
    """0.5 is 1 m to the left. To the right, 3 m away, 8 lead to much more, 0.5 lead to nothing: then the
    shortest way counts."""
    cube = lambda x, y: int(x > 6.0)  # noqa: E731

    def gain(right: float) -> LocatedGain:
        return LocatedGain(lambda x, y: right if x > 8.7 else 0.5 if x < 5.2 else 0.0, cube)

    assert choose(policy_of(), gain(8.0), 6.0, 1.5).stops[0].xy_m[0] > 6.0
    assert choose(policy_of(), gain(0.5), 6.0, 1.5).stops[0].xy_m[0] < 6.0


@pytest.mark.parametrize(
    ("left", "away_m", "why"),
    [
        (2.0, 3.0, None),
        (0.9, 3.0, "only gain 0.90 is left of the target's 2.00"),
        (0.1, 3.0, "target already seen: only gain 0.10 is left of it"),
        (0.1, 0.0, "only gain 0.10 is left of the target's 2.00"),
    ],
)
def test_a_view_is_looked_at_anew_when_its_gain_has_fallen(
    left: float, away_m: float, why: str | None
) -> None:
    policy = policy_of()
    choice = choose(policy, LocatedGain(lambda x, y: 2.0, lambda x, y: 7), 1.5, 1.5)
    cycle = cycle_on(room(120, 30), GainByPlace(lambda x, y: left), 1.5, 1.5)
    (view,) = cycle.score(np.array([choice.stops[0].cell]))
    assert policy.why_drop(view, view.yaw_rad, away_m) == why
    restored = policy_of()
    restored.restore(policy.state())
    assert restored.why_drop(view, view.yaw_rad, away_m) == why
