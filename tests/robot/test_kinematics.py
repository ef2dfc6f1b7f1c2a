import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.robot.kinematics import turned_towards, wrapped

ANGLE = st.floats(-20.0, 20.0)


@given(ANGLE)
def test_wrapping_keeps_the_direction(angle):
    assert -np.pi < wrapped(angle) <= np.pi
    assert np.exp(1j * wrapped(angle)) == pytest.approx(np.exp(1j * angle), abs=1e-9)


def test_half_a_turn_is_plus_pi():
    assert wrapped(-np.pi) == np.pi
    assert wrapped(3 * np.pi) == pytest.approx(np.pi)


@given(ANGLE, ANGLE, st.floats(0.1, 3.0), st.floats(0.0, 5.0))
def test_a_turn_takes_the_time_of_the_shorter_way(yaw, target, rate, available):
    difference = abs(wrapped(target - yaw))
    reached, left = turned_towards(yaw, target, rate, available)
    if difference / rate <= available:
        assert reached == wrapped(target)
        assert left == pytest.approx(available - difference / rate)
    else:
        assert left == 0.0
        assert abs(wrapped(target - reached)) == pytest.approx(difference - rate * available, abs=1e-9)
