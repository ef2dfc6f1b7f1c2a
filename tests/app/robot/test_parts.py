"""The parts of the robot client that decide, in the tests' own time."""

from __future__ import annotations

import math
import queue
import re
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from app.robot.camera import CameraLoop
from app.robot.clock import RobotClock
from app.robot.commands import CommandDesk
from app.robot.control import ControlLoop
from app.robot.credits import Credits, OnItsWay
from app.robot.dead_man import DeadMan
from app.robot.link_faults import FrameFaults, LinkFaults, TakenAt
from hgs_core.live.messages import Answer, FollowPath, Frame, LimitSpeed, Stop
from hgs_core.simulation.driven_world import BodyFaults
from tests.app.robot.robots import world


def path(command, *positions_m, now_s=100.0, valid_for_s=1.0, yaws_rad=None):
    positions = [[*map(float, position)] for position in positions_m]
    return FollowPath(
        now_s=now_s,
        command=command,
        valid_for_s=valid_for_s,
        positions_m=positions,
        yaws_rad=yaws_rad if yaws_rad is not None else [None] * len(positions),
        headings_rad=None,
        timed={},
    )


class Desk:
    """A desk with a robot, whose clock stands at 5 s when the service's says 100 s."""

    def __init__(self):
        self.robot = world().robot
        self.acks = []
        self.desk = CommandDesk(self.robot, self.acks.append)
        self.desk.begin()
        self.desk.heard(100.0, 5.0)

    def obey(self, command, received_s=5.0):
        self.desk.obey(command, received_s)
        return self.acks[-1] if self.acks else None

    def live(self, duration_s):
        for _ in range(round(duration_s / 0.02)):
            self.robot.tick()
            self.desk.settle()


def test_a_stale_path_is_refused_whatever_the_clocks_say():
    desk = Desk()
    late = desk.obey(path(1, (0, 0), (1, 0)), received_s=6.2)
    assert not late.accepted
    assert late.reason == "it comes 1.20 s late, and was valid for 1.00 s"
    assert desk.obey(path(2, (0, 0), (1, 0)), received_s=5.9).accepted
    assert desk.obey(path(3, (0, 0), (1, 0), now_s=math.nan)).accepted is False


def test_the_quickest_message_tells_what_late_means():
    desk = Desk()
    desk.desk.heard(101.0, 5.4)  # 0.6 s quicker than the first: that one was late
    assert not desk.obey(path(1, (0, 0), (1, 0), now_s=101.0), received_s=6.5).accepted
    assert desk.obey(path(2, (0, 0), (1, 0), now_s=102.0), received_s=6.5).accepted


def test_a_new_connection_has_a_clock_and_numbers_of_its_own():
    desk = Desk()
    assert desk.obey(path(7, (0, 0), (0.2, 0))).accepted
    desk.live(3.0)
    desk.desk.begin()
    desk.desk.heard(3.0, 9.0)
    assert desk.desk.obeyed == 7
    assert desk.obey(path(1, (0.2, 0), (0.4, 0), now_s=3.0), received_s=9.1).accepted


def test_numbers_only_rise_and_stop_is_always_obeyed():
    desk = Desk()
    assert desk.obey(path(5, (0, 0), (2, 0))).accepted
    desk.live(1.0)
    assert not desk.obey(path(4, (0, 0), (0, 1))).accepted
    assert desk.obey(Stop(now_s=100.0, command=3, reason="old, but a stop")).accepted
    assert desk.robot.moment.arrived
    assert desk.desk.obeyed == 5
    assert not desk.obey(LimitSpeed(now_s=100.0, command=4, max_speed_mps=0.1)).accepted


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (path(1, (0.3, 0), (1, 0)), r"begins 0\.30 m from the robot at \(0\.00, 0\.00\)"),
        (path(1, (0, 0), (math.inf, 0)), "positions that are not finite"),
        (path(1, (0, 0), (1, 0), yaws_rad=[None, math.nan]), "yaws or headings that are not finite"),
        (path(1, (0, 0), (1, 0), yaws_rad=[None]), "2 positions, 1 yaws and no headings"),
        (path(1, (0, 0, 0), (1, 0, 0)), "pairs of numbers"),
        (LimitSpeed(now_s=100.0, command=1, max_speed_mps=-1.0), "no speed limit"),
        (LimitSpeed(now_s=100.0, command=1, max_speed_mps=math.nan), "no speed limit"),
    ],
)
def test_what_cannot_be_obeyed_is_refused_with_the_reason(command, reason):
    desk = Desk()
    ack = desk.obey(command)
    assert not ack.accepted
    assert re.search(reason, ack.reason)
    assert desk.robot.moment.arrived
    assert desk.desk.obeyed == 0
    assert desk.desk.refused == 1


def test_a_command_that_comes_twice_is_answered_twice_and_obeyed_once():
    desk = Desk()
    first = desk.obey(path(1, (0, 0), (0.2, 0)))
    desk.live(3.0)
    assert desk.obey(path(1, (0, 0), (0.2, 0)), received_s=90.0) == first
    assert desk.robot.moment.standing
    assert desk.desk.accepted == 1


def test_a_path_waits_for_the_robot_to_stand():
    desk = Desk()
    desk.obey(path(1, (0, 0), (3, 0)))
    desk.live(1.5)
    here = desk.robot.state.x_m + 0.2
    desk.obey(path(2, (here, 0), (here, 1)))
    assert [ack.command for ack in desk.acks] == [1]
    desk.live(1.0)
    assert (desk.acks[-1].command, desk.acks[-1].accepted) == (2, True)
    desk.live(10.0)
    assert desk.robot.state.y_m == pytest.approx(1.0, abs=0.02)


def test_a_path_that_braking_leads_away_from_is_refused_from_the_stand():
    desk = Desk()
    desk.obey(path(1, (0, 0), (3, 0)))
    desk.live(1.5)
    desk.obey(path(2, (desk.robot.state.x_m, 0), (0, 0)))
    desk.live(1.0)
    assert not desk.acks[-1].accepted
    assert "from the robot" in desk.acks[-1].reason


@pytest.mark.parametrize("overtaker", ["stop", "path", "dead man"])
def test_a_waiting_path_is_refused_when_something_comes_before_the_stand(overtaker):
    desk = Desk()
    desk.obey(path(1, (0, 0), (3, 0)))
    desk.live(1.5)
    here = desk.robot.state.x_m + 0.2
    desk.obey(path(2, (here, 0), (here, 1)))
    if overtaker == "stop":
        desk.obey(Stop(now_s=100.0, command=3, reason=""))
    elif overtaker == "path":
        desk.obey(path(3, (here, 0), (here, -1)))
    else:
        desk.desk.drop("nothing was heard")
    desk.live(10.0)
    answers = {ack.command: ack.accepted for ack in desk.acks}
    assert answers[2] is False
    assert answers.get(3, True)
    assert desk.robot.state.y_m == pytest.approx(-1.0 if overtaker == "path" else 0.0, abs=0.02)


def test_the_dead_man_trips_once_for_every_silence():
    dead_man = DeadMan()
    assert not dead_man.trips(1e9), "before anybody has spoken nothing moves it"
    dead_man.heard(1.0)
    assert not dead_man.trips(100.0), "nor without a limit"
    dead_man.arm(0.5, 100.0)
    assert not dead_man.trips(100.5)
    assert dead_man.trips(100.52)
    assert not dead_man.trips(200.0)
    dead_man.heard(200.0)
    assert not dead_man.trips(200.4)
    assert dead_man.trips(200.6)


@pytest.mark.parametrize("drive", ["wheeled", "ackermann", "holonomic"])
def test_a_silent_service_stops_the_body_within_its_brakes(drive):
    now = [0.0]
    driven = world(drive=drive)
    clock, dead_man, acks, said = RobotClock(monotonic_s=lambda: now[0]), DeadMan(), [], []
    desk = CommandDesk(driven.robot, acks.append)
    control = ControlLoop(driven.robot, desk, dead_man, clock, said.append)
    dead_man.arm(0.5, 0.0)
    desk.begin()
    desk.heard(100.0, 0.0)
    way = path(1, *[(0.05 * k, 0) for k in range(50)])
    if drive == "ackermann":
        way = msgspec.structs.replace(way, headings_rad=[0.0] * 50)
    desk.obey(way, 0.0)
    assert acks[-1].accepted
    for k in range(1, 13):
        dead_man.heard(0.1 * k)
        control.live_until(0.1 * k)
    moving_m = driven.robot.state.x_m
    # The loop is late by seconds: the body stops as if it had not been.
    control.live_until(10.0)
    assert control.dead_man_stops == 1
    assert driven.robot.moment.standing
    assert "brakes and drops its path" in said[0]
    (stopping_m,) = control.stopping_m
    assert stopping_m <= 1.0 / (2 * 1.5) + 0.03
    assert driven.robot.state.x_m <= moving_m + 0.52 + stopping_m
    dead_man.heard(10.0)
    control.live_until(11.0)
    assert control.dead_man_stops == 2
    assert "stays where it stands" in said[1]
    assert driven.robot.moment.state.collisions == 0


def test_a_credit_comes_back_once():
    credits = Credits(2)
    way = OnItsWay(taken_s=1.0, sent_s=1.1)
    credits.spend(4, way)
    credits.spend(5, way)
    assert credits.left == 0
    taken = Answer(now_s=0.0, sequence=4, fate="taken")
    assert credits.answered(taken) == way
    assert credits.answered(taken) is None
    assert credits.answered(Answer(now_s=0.0, sequence=99, fate="taken")) is None
    assert credits.left == 1


def test_a_robot_without_credits_knows_how_long_it_has_waited():
    credits = Credits(2)
    credits.spend(1, OnItsWay(taken_s=1.0, sent_s=2.0))
    assert credits.waits_s(50.0) == 0.0, "there is another"
    credits.spend(2, OnItsWay(taken_s=3.0, sent_s=4.0))
    assert credits.waits_s(12.5) == 10.5


def test_the_clock_is_told_with_its_offset():
    now = [50.0]
    clock = RobotClock(1000.0, monotonic_s=lambda: now[0])
    now[0] = 52.5
    assert clock.now_s() == 2.5
    assert clock.told_s(2.5) == 1002.5


def frame(sequence):
    return TakenAt(Frame(sequence=sequence, time_s=0.1 * sequence, pose=None, colour=b"c", depth=b"d"), 0.0)


def passed(faults, seed=0, n=400, credits_left=5):
    frame_faults = FrameFaults(faults, np.random.default_rng(seed))
    sent = [
        one.frame.sequence
        for k in range(n)
        for one in frame_faults.passed(frame(k), credits_left=credits_left)
    ]
    return sent, frame_faults


def test_link_faults_are_those_asked_for_and_the_same_again():
    assert passed(LinkFaults())[0] == list(range(400))
    faults = LinkFaults(drop_frames=0.2, reorder_frames=0.3)
    sent, counted = passed(faults)
    assert sent == passed(faults)[0]
    assert sent != passed(faults, seed=1)[0]
    assert counted.lost == pytest.approx(80, abs=25)
    overtaken = sum(later < earlier for earlier, later in pairwise(sent))
    assert overtaken == counted.overtaken > 30
    assert len(set(sent)) == len(sent)


def test_two_frames_need_two_credits():
    sent, counted = passed(LinkFaults(reorder_frames=0.5), credits_left=1)
    assert sent == sorted(sent)
    assert len(sent) + counted.lost >= 399


def test_a_sighting_is_told_where_the_robot_believes_to_be():
    driven = world(faults=BodyFaults(drift_percent=5.0, drift_deg_per_m=5.0, depth_holes=0.3))
    desk = CommandDesk(driven.robot, [].append)
    desk.obey(path(1, (0, 0), (2, 0), valid_for_s=math.inf), 0.0)
    driven.robot.advance(2.0)
    sighting = driven.sense()
    estimate, state = driven.robot.moment.estimate, driven.robot.state
    np.testing.assert_allclose(sighting.frame.T_world_camera.translation[:2], [estimate.x_m, estimate.y_m])
    np.testing.assert_allclose(sighting.T_world_camera.translation[:2], [state.x_m, state.y_m])
    np.testing.assert_allclose(sighting.scan.origin_m[:2], [estimate.x_m, estimate.y_m])
    assert sighting.scan.bearings_rad[0] == pytest.approx(estimate.yaw_rad)
    assert (sighting.frame.depth_m == 0).mean() > 0.05
    again = world(faults=BodyFaults(drift_percent=5.0, drift_deg_per_m=5.0, depth_holes=0.3))
    CommandDesk(again.robot, [].append).obey(path(1, (0, 0), (2, 0), valid_for_s=math.inf), 0.0)
    again.robot.advance(2.0)
    np.testing.assert_array_equal(again.sense().frame.depth_m, sighting.frame.depth_m)


class Album:
    """A `Link` that takes every frame."""

    def __init__(self):
        self.frames = queue.Queue()

    def may_send_frame(self):
        return True

    def send_frame(self, frame, taken_s):
        self.frames.put(frame)


def test_no_two_frames_are_of_one_moment_though_the_body_is_late():
    driven, album = world(), Album()
    loop = CameraLoop(driven, RobotClock(), interval_s=0.01, depth_format="png")
    loop.start(album)
    times = [album.frames.get(timeout=30.0).time_s]
    for _ in range(3):
        driven.robot.tick()
        times.append(album.frames.get(timeout=30.0).time_s)
    loop.close()
    assert times == pytest.approx([0.0, 0.02, 0.04, 0.06])
    assert album.frames.empty()
