"""The whole robot against a service that does what the test says. Nothing here depends on how fast it is."""

from __future__ import annotations

import math

import msgspec
import pytest

from app.robot.clock import RobotClock
from app.robot.link_faults import LinkFaults
from app.robot.outcome import MissionWord, Outcome
from hgs_core.errors import RobotError
from hgs_core.live.cameras import RobotCameras
from hgs_core.live.images import decoded_colour, decoded_depth
from hgs_core.live.messages import Frame, Heartbeat, Hello, LimitSpeed, Refusal, Report, Stop
from hgs_core.robot.pure_pursuit import BRAKING_MPS2
from hgs_core.simulation.driven_robot import TICK_S
from tests.app.robot.fake_service import FakeService
from tests.app.robot.robots import CAMERA, live_robot, running, world


@pytest.fixture
def service():
    with FakeService().serving() as service:
        yield service


@pytest.fixture
def start(service):
    """Puts a robot in the room and lets it connect: `start(drive="ackermann")`."""
    contexts = []

    def begin(*, drive="wheeled", blocked=False, wait=True, offset_s=0.0, **how):
        said, clock = [], RobotClock(offset_s)
        driven = world(drive=drive, blocked=blocked)
        context = running(service.url, live_robot(driven, clock, said, drive=drive), said, clock=clock, **how)
        contexts.append(context)
        robot = context.__enter__()
        if wait:
            service.wait_for(lambda: service.of(Report))
        return robot

    yield begin
    for context in contexts:
        context.__exit__(None, None, None)


def error_of(robot):
    """What it failed with, taken from it: it is not raised again when the test ends."""
    robot._thread.join(30.0)
    error, robot.error = robot.error, None
    robot.outcome = Outcome.ENDED
    assert isinstance(error, RobotError)
    return error


def test_it_says_hello_sends_frames_and_follows_a_path(service, start):
    robot = start(offset_s=777.0)
    hello = service.of(Hello)[0]
    assert hello.robot["drive"] == "differential"
    assert hello.report.standing
    service.say(service.path(1, [[0.0, 0.0], [0.8, 0.0]], yaws_rad=[None, 1.0]))
    assert service.ack(1).accepted
    service.wait_for(lambda: service.report.waypoints_passed == 2 and service.report.standing)
    report = service.report
    assert (report.command, report.arrived, report.collisions) == (1, True, 0)
    assert report.x_m == pytest.approx(0.8, abs=0.02)
    assert report.yaw_rad == pytest.approx(1.0, abs=0.02)
    service.wait_for(lambda: len(service.of(Frame)) >= 5)
    frames, camera = service.of(Frame), RobotCameras.of(hello).colour.intrinsics
    assert decoded_colour(frames[0], camera).shape == (CAMERA.height, CAMERA.width, 3)
    assert decoded_depth(frames[0], camera).max() > 1.0
    assert frames[0].time_s > 777.0
    assert len(frames[0].scan.ranges_m) == 4 * 36
    assert frames[0].pose[3] == pytest.approx(0.0)
    assert service.refused == []
    service.end()
    assert robot.join() is Outcome.ENDED
    assert robot.client.ending == "all was seen"
    assert robot.client.figures.taken >= 5


def test_a_frame_tells_where_the_robot_was_when_it_was_taken(service, start):
    robot = start()
    service.say(service.path(1, [[0.0, 0.0], [2.0, 0.0]]))
    service.wait_for(lambda: service.report.arrived and service.report.command == 1)
    service.end()
    robot.join()
    taken = robot.onboard.camera.taken
    for frame in service.of(Frame):
        at = taken[frame.sequence]
        assert frame.time_s == at.timestamp_s
        assert frame.pose[3] == pytest.approx(at.T_world_camera.translation[0], abs=1e-9)


@pytest.mark.parametrize("drive", ["ackermann", "holonomic"])
def test_other_drives_follow_their_paths(service, start, drive):
    start(drive=drive)
    path = service.path(1, [[0.1 * k, 0.0] for k in range(9)])
    headings = [0.0] * 9 if drive == "ackermann" else None
    service.say(msgspec.structs.replace(path, headings_rad=headings))
    assert service.ack(1).accepted
    service.wait_for(lambda: service.report.command == 1 and service.report.standing)
    assert service.report.x_m == pytest.approx(0.8, abs=0.03)


def test_what_is_refused_is_refused_with_its_reason(service, start):
    start()
    service.say(service.path(1, [[0.0, 0.0], [0.5, 0.0]], late_s=60.0))
    assert "late" in service.ack(1).reason
    service.say(service.path(2, [[1.0, 0.0], [1.5, 0.0]]))
    assert "begins 1.00 m from the robot" in service.ack(2).reason
    service.say(service.path(3, [[0.0, 0.0], [math.nan, 0.0]]))
    assert "not finite" in service.ack(3).reason
    service.say(Stop(now_s=service.now_s(), command=9, reason="the operator's"))
    assert service.ack(9).accepted
    service.say(service.path(8, [[0.0, 0.0], [0.5, 0.0]]))
    assert "command 9 is newer" in service.ack(8).reason
    service.wait_for(lambda: service.report.command == 9)
    assert service.report.x_m == 0.0


def test_a_new_path_while_it_drives_is_taken_up_from_the_stand(service, start):
    start()
    service.say(LimitSpeed(now_s=service.now_s(), command=1, max_speed_mps=0.1))
    service.say(service.path(2, [[0.0, 0.0], [2.0, 0.0]]))
    service.wait_for(lambda: service.report.x_m > 0.03)
    here = service.report.x_m + 0.05
    service.say(
        LimitSpeed(now_s=service.now_s(), command=3, max_speed_mps=None),
        service.path(4, [[here, 0.0], [here, 0.3]]),
    )
    assert service.ack(4).accepted
    service.wait_for(lambda: service.report.command == 4 and service.report.standing)
    assert service.report.y_m == pytest.approx(0.3, abs=0.02)


def test_silence_stops_the_robot_and_it_goes_on_when_spoken_to(service, start):
    service.dead_man_s = 1.0
    robot = start()
    service.say(LimitSpeed(now_s=service.now_s(), command=1, max_speed_mps=0.3))
    service.say(service.path(2, [[0.0, 0.0], [2.5, 0.0]]))
    service.wait_for(lambda: service.report.x_m > 0.1)
    service.heartbeats = service.answers = False
    service.wait_for(lambda: service.report.standing and service.report.arrived)
    assert service.report.x_m < 2.4
    assert robot.onboard.control.dead_man_stops == 1
    assert robot.onboard.control.stopping_m[0] <= 0.3**2 / (2 * BRAKING_MPS2) + 0.3 * TICK_S
    assert any("nothing heard for 1 s: the robot brakes" in line for line in robot.said)
    service.heartbeats = True
    here = service.report.x_m
    service.say(service.path(3, [[here, 0.0], [here, 0.3]]))
    assert service.ack(3).accepted
    service.wait_for(lambda: service.report.waypoints_passed == 2)


def test_a_cut_connection_is_made_again(service, start):
    robot = start()
    service.say(service.path(5, [[0.0, 0.0], [0.5, 0.0]]))
    service.wait_for(lambda: service.report.command == 5)
    for again in (2, 3):
        service.cut()
        service.wait_for(lambda again=again: service.connections == again)
    hello = service.of(Hello)[-1]
    assert hello.report.command == 5
    service.wait_for(lambda: service.report.standing)
    here = service.report.x_m
    # A service that was started again counts its commands from 1.
    service.say(service.path(1, [[here, 0.0], [here, 0.3]]))
    assert service.ack(1).accepted
    service.end()
    assert robot.join() is Outcome.ENDED
    assert robot.client.figures.connections == 3


def test_a_hello_that_was_spoilt_on_its_way_is_said_again(service, start, monkeypatch):
    """The service speaks on, but does not welcome who did not introduce itself."""
    monkeypatch.setattr("app.robot.client._WELCOME_S", 0.5)
    service.deaf_to_hellos = 2
    robot = start()
    service.wait_for(lambda: robot.client.figures.taken > 2)
    assert service.deaf_to_hellos == 0
    assert service.connections == 1
    assert any("no welcome for" in line for line in robot.said)
    service.end()
    assert robot.join() is Outcome.ENDED


def test_rubbish_changes_nothing(service, start):
    robot = start()
    service.say(service.path(1, [[0.0, 0.0], [0.5, 0.0]]))
    for rubbish in (b"", b"\xff" * 200, b"\x80", "text", b"\x91" * 5000):
        service.say(rubbish)
    service.say(Refusal(now_s=service.now_s(), reason="no"))
    service.say(Heartbeat(now_s=math.nan))
    service.wait_for(lambda: service.report.waypoints_passed == 2)
    assert service.connections == 1
    service.end()
    robot.join()
    figures = robot.client.figures
    assert (figures.not_understood, figures.refusals) == (5, 1)


def test_the_same_command_twice_is_obeyed_once_and_end_may_come_twice(service, start):
    robot = start()
    path = service.path(1, [[0.0, 0.0], [0.4, 0.0]])
    service.say(path)
    service.wait_for(lambda: service.report.command == 1 and service.report.standing)
    service.say(path)
    service.wait_for(lambda: len([a for a in service.received if getattr(a, "command", 0) == 1]) >= 2)
    assert service.ack(1).accepted
    assert service.report.x_m == pytest.approx(0.4, abs=0.02)
    service.say(service.ending(), service.path(2, [[0.4, 0.0], [0.8, 0.0]]), service.ending())
    assert robot.join() is Outcome.ENDED
    assert robot.onboard.world.robot.state.x_m == pytest.approx(0.4, abs=0.02)


def test_no_more_frames_than_credits(service, start):
    service.answers = False
    robot = start()
    service.wait_for(lambda: len(service.of(Frame)) == 3 and robot.onboard.camera.skipped >= 5)
    assert service.most_on_their_way == 3
    service.cut()  # a new connection has its credits afresh
    service.wait_for(lambda: len(service.of(Frame)) == 6)


def test_reordered_frames_are_refused_and_cost_no_credit_for_good(service, start):
    start(faults=LinkFaults(reorder_frames=0.5, drop_frames=0.1))
    service.wait_for(lambda: len(service.of(Frame)) >= 12 and len(service.refused) >= 3)
    assert all("numbers must rise" in reason for reason in service.refused)


def test_latency_delays_and_keeps_the_order(service, start):
    robot = start(faults=LinkFaults(latency_s=0.2))
    service.say(service.path(1, [[0.0, 0.0], [0.3, 0.0]]))
    assert service.ack(1).accepted, "what is always late is not late"
    service.wait_for(lambda: robot.client.figures.taken >= 2)
    assert min(robot.client.figures.sent_to_map_s) >= 0.4
    sequences = [frame.sequence for frame in service.of(Frame)]
    assert sequences == sorted(sequences)


def test_interrupted_it_stands_and_leaves_the_mission_alone(service, start):
    robot = start()
    service.say(service.path(1, [[0.0, 0.0], [2.5, 0.0]]))
    service.wait_for(lambda: service.report.x_m > 0.2)
    robot.interrupt()
    assert robot.join() is Outcome.INTERRUPTED
    assert robot.onboard.standing


def test_contact_is_reported(service, start):
    start(blocked=True)
    service.say(service.path(1, [[0.0, 0.0], [2.5, 0.0]]))
    service.wait_for(lambda: service.report.collisions == 1 and service.report.standing)
    assert service.report.arrived
    assert service.report.x_m == pytest.approx(0.75, abs=0.02)


def test_a_mission_that_is_over_is_not_waited_for(service, start):
    service.refuse_with = 409
    robot = start(wait=False, word=MissionWord(over="the mission is completed"))
    assert robot.join() is Outcome.ENDED
    assert robot.client.ending == "the mission is completed"


def test_a_service_that_stays_away_is_given_up(service, start):
    service.refuse_with = 503
    robot = start(wait=False, give_up_after_s=0.5)
    assert robot.join() is Outcome.GIVEN_UP
    assert "HTTP 503 not now" in robot.client.ending


def test_a_token_that_is_refused_is_an_error_at_once(service, start):
    service.refuse_with = 401
    assert "HTTP 401" in str(error_of(start(wait=False)))


def test_a_message_that_is_too_large_may_be_a_broken_lines(service, start):
    """As long as frames are taken in between, the robot connects again."""
    robot = start(give_up_after_s=30.0)
    for again in range(2, 8):
        taken = robot.client.figures.taken
        service.wait_for(lambda taken=taken: robot.client.figures.taken > taken)
        service.close_with(1009)
        service.wait_for(lambda again=again: service.connections == again)
    service.end()
    assert robot.join() is Outcome.ENDED


def test_messages_that_are_too_large_every_time_are_its_own(service, start):
    service.answers = False
    robot = start(give_up_after_s=30.0)
    for again in range(2, 7):
        service.close_with(1009)
        if again < 6:
            service.wait_for(lambda again=again: service.connections == again)
    assert "1009" in str(error_of(robot))
    assert service.connections == 5
