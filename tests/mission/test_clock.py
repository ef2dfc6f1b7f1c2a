"""Two clocks: one counts, one measures."""

import pytest

from hgs_core.mission.clock import (
    IDLE_SHARE,
    Clock,
    ClockKind,
    LockstepClock,
    NextFrame,
    RealClock,
    clock_of,
)
from tests.mission.passing_time import PassingTime

INTERVAL_S = 0.4


def never() -> bool:
    return False


@pytest.fixture
def time() -> PassingTime:
    return PassingTime()


@pytest.fixture
def clock(time: PassingTime) -> RealClock:
    clock = RealClock(INTERVAL_S, now=time.now, sleep=time.sleep)
    clock.elapsed_s(nominal_s=0.0)  # begins
    return clock


def left(clock: Clock) -> bool:
    assert clock.time_left is not None
    return clock.time_left()


def test_each_kind_has_its_clock() -> None:
    for kind in ClockKind:
        assert clock_of(kind, INTERVAL_S).kind is kind


def test_lockstep_counts_nominal_times() -> None:
    clock = LockstepClock(INTERVAL_S)
    assert clock.elapsed_s(nominal_s=0.1) == 0.1
    assert clock.time_left is None
    assert clock.next_frame(interrupted=never) == NextFrame(after_s=INTERVAL_S, dropped=0)


def test_real_time_is_told_once(clock: RealClock, time: PassingTime) -> None:
    time.sleep(0.15)
    assert clock.elapsed_s(nominal_s=7.0) == pytest.approx(0.15)
    assert clock.elapsed_s(nominal_s=7.0) == 0.0


def test_the_simulators_time_does_not_count(clock: RealClock, time: PassingTime) -> None:
    with clock.stopped():
        time.sleep(30.0)
    time.sleep(0.1)
    assert clock.elapsed_s(nominal_s=0.0) == pytest.approx(0.1)


def test_time_goes_on_after_what_failed_in_the_simulator(clock: RealClock, time: PassingTime) -> None:
    def fail() -> None:
        with clock.stopped():
            time.sleep(3.0)
            raise OSError("scene")

    with pytest.raises(OSError, match="scene"):
        fail()
    assert clock.elapsed_s(nominal_s=0.0) == 0.0


def test_the_time_left_ends_a_share_before_the_next_frame(clock: RealClock, time: PassingTime) -> None:
    time.sleep((1.0 - IDLE_SHARE) * INTERVAL_S - 1e-3)
    assert left(clock)
    time.sleep(2e-3)
    assert not left(clock)


def test_it_waits_for_the_frame_that_is_due_next(clock: RealClock, time: PassingTime) -> None:
    time.sleep(0.15)
    assert clock.elapsed_s(nominal_s=0.0) == pytest.approx(0.15)
    due = clock.next_frame(interrupted=never)
    assert due.after_s == pytest.approx(0.25)
    assert due.dropped == 0
    assert time.now() == pytest.approx(time.began_s + 0.4)


def test_who_comes_late_takes_the_newest_frame_and_drops_the_others(
    clock: RealClock, time: PassingTime
) -> None:
    time.sleep(1.7)  # 0.4, 0.8, 1.2 and 1.6 fell due
    due = clock.next_frame(interrupted=never)
    assert due.dropped == 3
    assert due.after_s == pytest.approx(1.6)
    assert left(clock)
    time.sleep(0.27)  # 1.97: less than a tenth before 2.0
    assert not left(clock)
    assert clock.elapsed_s(nominal_s=0.0) == pytest.approx(0.37)


def test_a_frame_that_fell_due_during_planning_is_taken_at_once(clock: RealClock, time: PassingTime) -> None:
    time.sleep(0.5)
    clock.elapsed_s(nominal_s=0.0)
    assert not left(clock)
    assert clock.next_frame(interrupted=never) == NextFrame(after_s=0.0, dropped=0)
    assert clock.next_frame(interrupted=never).after_s == pytest.approx(0.3)


def test_the_wait_ends_when_it_is_interrupted(clock: RealClock, time: PassingTime) -> None:
    polls = iter([False, False, True])
    clock.next_frame(interrupted=lambda: next(polls))
    assert time.now() - time.began_s < 0.1
