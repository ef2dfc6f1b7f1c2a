"""Axis-aligned boxes are half open."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hgs_core.errors import ConfigError
from hgs_core.geometry.boxes import Box

UNIT = Box(lower_m=np.zeros(3), upper_m=np.ones(3))


def test_the_lower_face_is_inside_and_the_upper_is_not() -> None:
    points = np.array([[0.0, 0, 0], [1, 1, 1], [0.5, 0.5, 1.0], [0.999, 0, 0.5], [-1e-9, 0.5, 0.5]])
    assert UNIT.contains(points).tolist() == [True, False, False, True, False]


def test_any_batch_of_points_keeps_its_shape() -> None:
    assert UNIT.contains(np.full((2, 3, 4, 3), 0.5)).shape == (2, 3, 4)


def test_nan_is_nowhere() -> None:
    assert not UNIT.contains(np.full((1, 3), np.nan)).any()


@given(st.floats(0.001, 10), st.floats(-10, 10))
def test_boxes_that_share_a_face_share_no_point(size: float, x: float) -> None:
    left = Box(lower_m=np.array([-100.0, -1, -1]), upper_m=np.array([size, 1.0, 1.0]))
    right = Box(lower_m=np.array([size, -1.0, -1.0]), upper_m=np.array([100.0, 1, 1]))
    point = np.array([[x, 0.0, 0.0]])
    assert left.contains(point)[0] != right.contains(point)[0]


@given(st.floats(-0.4, 5))
def test_growing_moves_every_face_and_keeps_the_centre(margin_m: float) -> None:
    assume(margin_m != 0)
    grown = UNIT.expanded(margin_m)
    np.testing.assert_allclose(grown.size_m, 1 + 2 * margin_m)
    np.testing.assert_allclose(grown.centre_m, UNIT.centre_m)


@pytest.mark.parametrize("upper", [[1.0, 0.0, 1.0], [1.0, -1.0, 1.0], [np.nan, 1.0, 1.0]])
def test_an_empty_box_is_refused(upper: list[float]) -> None:
    with pytest.raises(ConfigError, match="lower < upper"):
        Box(lower_m=np.zeros(3), upper_m=np.array(upper))


def test_shrinking_past_the_centre_is_refused() -> None:
    with pytest.raises(ConfigError):
        UNIT.expanded(-0.5)
