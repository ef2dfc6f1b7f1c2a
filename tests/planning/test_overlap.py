"""What views show together, and which of them are needed."""

from __future__ import annotations

import numpy as np
import pytest

from hgs_core.gain.viewpoint import SurfaceInView
from hgs_core.planning.overlap import Overlap, distinct_views


def sees(**areas_m2: float) -> SurfaceInView:
    """A view of cubes `a`, `b`, ... with the area behind each."""
    cubes = sorted(areas_m2)
    return SurfaceInView(
        cubes=np.array([ord(cube) for cube in cubes], np.int64),
        area_m2=np.array([areas_m2[cube] for cube in cubes]),
    )


def test_what_two_views_show_is_counted_once() -> None:
    """The first shows all 4 of `a`; of the second's 3 + 2, the 2 of `b` remain, and nothing of the third."""
    overlap = Overlap(np.array([4.0, 5.0, 1.0]), [sees(a=4.0), sees(a=3.0, b=2.0), sees(a=1.0)])
    assert overlap.added_to([]).tolist() == [4.0, 5.0, 1.0]
    assert overlap.added_to([0]) == pytest.approx([0.0, 2.0, 0.0])
    assert overlap.added_to([0, 1]) == pytest.approx([0.0, 0.0, 0.0])


def test_a_glimpse_leaves_what_a_better_view_shows_besides() -> None:
    overlap = Overlap(np.array([1.0, 4.0]), [sees(a=1.0), sees(a=4.0)])
    assert overlap.added_to([0]) == pytest.approx([0.0, 3.0])


def test_gain_that_lies_behind_no_cube_is_shared_by_none() -> None:
    overlap = Overlap(np.array([2.0, 2.0]), [sees(), sees()])
    assert overlap.added_to([0]).tolist() == [2.0, 2.0]


def test_of_many_views_of_a_room_one_is_kept() -> None:
    views = [sees(a=3.0, b=2.0) for _ in range(50)]
    rows, gains = distinct_views(
        Overlap(np.full(50, 5.0), views),
        np.linspace(3.0, 6.0, 50),
        thresholds=np.full(50, 0.3),
        patience_m=2.0,
    )
    assert rows == [0]
    assert gains.tolist() == [5.0]


@pytest.mark.parametrize(("far_m", "kept"), [(4.9, 1), (5.1, 0)])
def test_a_better_view_is_worth_going_farther_but_not_any_way(far_m: float, kept: int) -> None:
    """4 against 2 of the same, the near one 1 m away: with a patience of 3 m 2 * (1 + 3) - 3 = 5 m are
    worth it."""
    overlap = Overlap(np.array([2.001, 4.0]), [sees(a=2.001), sees(a=4.0)])
    rows, _ = distinct_views(overlap, np.array([1.0, far_m]), thresholds=np.full(2, 2.0), patience_m=3.0)
    assert rows == [kept]


def test_what_is_near_is_not_left_out_for_what_will_show_it_too() -> None:
    """The near view shows half of what the far one does; on the way there it is to be had for nothing."""
    overlap = Overlap(np.array([2.0, 4.0]), [sees(a=2.0), sees(a=2.0, b=2.0)])
    rows, gains = distinct_views(overlap, np.array([1.0, 5.0]), thresholds=np.full(2, 0.3), patience_m=1.0)
    assert rows == [0, 1]
    assert gains.tolist() == [2.0, 2.0]


def test_nothing_is_chosen_of_nothing() -> None:
    rows, gains = distinct_views(
        Overlap(np.zeros(0), []), np.zeros(0), thresholds=np.zeros(0), patience_m=1.0
    )
    assert rows == []
    assert len(gains) == 0
