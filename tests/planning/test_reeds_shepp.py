"""Reeds and Shepp's ways: laws that every one of them obeys, and no sampled way is shorter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.native import kernels

ORIGIN = np.zeros((1, 3))
coordinate = st.floats(-6.0, 6.0)
angle = st.floats(-np.pi, np.pi)
piece = st.tuples(st.sampled_from([-1, 0, 1]), st.floats(-3.0, 3.0))


def driven(pieces) -> np.ndarray:
    """Where a car of turning radius 1 comes to from the origin."""
    x = y = yaw = 0.0
    for turn, length in pieces:
        if turn == 0:
            x, y = x + length * np.cos(yaw), y + length * np.sin(yaw)
        else:
            after = yaw + turn * length
            x, y = x + turn * (np.sin(after) - np.sin(yaw)), y - turn * (np.cos(after) - np.cos(yaw))
            yaw = after
    return np.array([x, y, yaw])


def length(goal, start=ORIGIN, radius: float = 1.0) -> float:
    return float(kernels.reeds_shepp_lengths(start, np.atleast_2d(goal), radius)[0, 0])


def test_by_hand():
    assert length([3.0, 0.0, 0.0]) == pytest.approx(3.0)
    assert length([-3.0, 0.0, 0.0]) == pytest.approx(3.0)  # straight back
    assert length([1.0, 1.0, np.pi / 2]) == pytest.approx(np.pi / 2)  # a quarter circle
    assert length([0.0, 0.0, np.pi]) == pytest.approx(np.pi)  # three arcs of 60 degrees: the three-point turn


@given(coordinate, coordinate, angle)
def test_every_word_leads_to_the_goal_and_one_always_does(x, y, yaw):
    words = kernels.reeds_shepp_words(np.array([x, y, yaw]))
    assert len(words) > 0
    for word in words:
        end = driven(word)
        np.testing.assert_allclose(end[:2], [x, y], atol=1e-7)
        assert abs(np.remainder(end[2] - yaw + np.pi, 2 * np.pi) - np.pi) < 1e-7


@given(coordinate, coordinate, angle)
def test_ways_are_as_long_there_as_back_and_mirrored_and_no_shorter_than_a_straight(x, y, yaw):
    there = length([x, y, yaw])
    assert there >= np.hypot(x, y) - 1e-9
    assert there >= abs(yaw) - 1e-9  # a heading turns by at most a radian a radius
    assert length(ORIGIN, start=np.array([[x, y, yaw]])) == pytest.approx(there, abs=1e-6)
    assert length([x, -y, -yaw]) == pytest.approx(there, abs=1e-6)
    assert length([-x, y, -yaw]) == pytest.approx(there, abs=1e-6)
    assert length([0.4 * x, 0.4 * y, yaw], radius=0.4) == pytest.approx(0.4 * there, abs=1e-6)


@given(st.lists(piece, min_size=1, max_size=6))
def test_no_sampled_way_is_shorter(pieces):
    assert length(driven(pieces)) <= sum(abs(part) for _, part in pieces) + 1e-7
