"""Steps are earned by mission time: no fraction is lost, and no wait brings a burst."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.mapping.accrued_steps import AccruedSteps


def spent(steps: AccruedSteps) -> int:
    n = 0
    while steps.spend():
        n += 1
    return n


def test_25_a_second_are_ten_in_every_interval_of_400_ms() -> None:
    steps = AccruedSteps(25.0, at_most_s=1.0)
    time_s, counts = 0.0, []
    for _ in range(500):
        steps.earn(time_s)
        counts.append(spent(steps))
        time_s += 0.4  # as the robot's clock adds up, rounding and all
    assert counts == [0] + [10] * 499


def test_fractions_are_carried_over() -> None:
    steps = AccruedSteps(6.25, at_most_s=1.0)  # 2.5 in 0.4 s
    counts = []
    for number in range(7):
        steps.earn(0.4 * number)
        counts.append(spent(steps))
    assert counts == [0, 2, 3, 2, 3, 2, 3]


def test_time_in_which_the_robot_stood_planning_counts() -> None:
    steps = AccruedSteps(25.0, at_most_s=1.0)
    counts = []
    for time_s in (0.0, 0.4, 0.9, 1.3):  # 0.1 s of planning before the third
        steps.earn(time_s)
        counts.append(spent(steps))
    assert counts == [0, 10, 12, 10]


def test_a_long_wait_earns_no_more_than_the_limit() -> None:
    steps = AccruedSteps(25.0, at_most_s=1.0)
    steps.earn(0.0)
    steps.earn(60.0)
    assert spent(steps) == 25
    for time_s in (60.8, 61.6, 62.4):  # nor does what is not spent pile up
        steps.earn(time_s)
    assert spent(steps) == 25


def test_time_that_runs_backwards_earns_nothing_twice() -> None:
    steps = AccruedSteps(10.0, at_most_s=5.0)
    for time_s in (0.0, 1.0, 0.5, 1.0, 1.2):
        steps.earn(time_s)
    assert spent(steps) == 12


@given(
    rate=st.floats(0.1, 200.0),
    waits=st.lists(st.floats(0.0, 0.9), min_size=1, max_size=50),
)
def test_what_is_spent_follows_time_within_one_step(rate: float, waits: list[float]) -> None:
    steps = AccruedSteps(rate, at_most_s=1.0 + 1.0 / rate)  # room for what is carried over
    steps.earn(0.0)
    time_s, n = 0.0, 0
    for wait in waits:
        time_s += wait
        steps.earn(time_s)
        n += spent(steps)
        assert rate * time_s - 1.0 - 1e-6 < n <= rate * time_s + 1e-5


def test_a_restored_one_goes_on_alike() -> None:
    steps = AccruedSteps(6.25, at_most_s=1.0)
    steps.earn(0.0)
    steps.earn(0.4)
    steps.spend()
    other = AccruedSteps(6.25, at_most_s=1.0)
    other.restore(steps.state())
    for one in (steps, other):
        one.earn(0.8)
    assert spent(steps) == spent(other) == pytest.approx(4)
