"""Controllers on their own: a point robot with exact time, whose wheels may slip."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgs_core.errors import RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.motion import GroundPose, Twist, moved
from hgs_core.robot.path import Path
from hgs_core.robot.pure_pursuit import BRAKING_MPS2
from hgs_core.robot.tracker import tracker_of
from tests.robot.test_vehicles import car_path

TICK_S = 0.02
ROUND = DifferentialConfig()
ANY_WAY = HolonomicConfig()
CAR = AckermannConfig()
ORIGIN = GroundPose(x_m=0.0, y_m=0.0, yaw_rad=0.0)
NAN = math.nan
CORNERS = Path(
    positions_m=np.array([[0.0, 0.0], [1.5, 0.0], [1.5, 1.2], [0.4, 1.6], [0.0, 1.65]]),
    yaws_rad=np.array([NAN, NAN, 1.0, NAN, -2.0]),
)


class Driven:
    """A robot without inertia that loses shares of what it is told: forward, sideways, turning."""

    def __init__(self, config, path, pose=ORIGIN, *, lost=(0.0, 0.0, 0.0), limit_mps=9.0):
        self.tracker = tracker_of(config, path, pose, limit_mps)
        self.pose, self.lost, self.time_s = pose, lost, 0.0
        self.poses, self.twists = [pose], []

    def tick(self):
        twist = self.tracker.twist(self.pose, TICK_S)
        ahead, aside, turned = (1.0 - share for share in self.lost)
        true = Twist(
            forward_mps=twist.forward_mps * ahead,
            left_mps=twist.left_mps * aside,
            turn_radps=twist.turn_radps * turned,
        )
        self.pose = moved(self.pose, true, TICK_S)
        self.poses.append(self.pose)
        self.twists.append(twist)
        self.time_s += TICK_S

    def to_the_end(self, limit_s=60.0):
        while not self.tracker.standing:
            assert self.time_s < limit_s
            self.tick()
        return self

    def off_m(self, path):
        """How far the robot was ever from the straight lines of a path [m]."""
        at = np.array([[pose.x_m, pose.y_m] for pose in self.poses])
        begin, step = path.positions_m[:-1], np.diff(path.positions_m, axis=0)
        share = np.einsum("nkd,kd->nk", at[:, None] - begin, step) / np.maximum((step**2).sum(1), 1e-12)
        foot = begin + np.clip(share, 0.0, 1.0)[..., None] * step
        return float(np.linalg.norm(at[:, None] - foot, axis=-1).min(axis=1).max())


@pytest.mark.parametrize("lost", [(0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (0.0, 0.0, 0.2)])
@pytest.mark.parametrize("config", [ROUND, ANY_WAY])
def test_a_round_robot_keeps_to_corners_and_takes_up_yaws(config, lost):
    robot = Driven(config, CORNERS, lost=lost).to_the_end()
    assert robot.tracker.waypoints_passed == 5
    assert math.hypot(robot.pose.x_m - 0.0, robot.pose.y_m - 1.65) < 0.02
    assert robot.pose.yaw_rad == pytest.approx(-2.0, abs=math.radians(1.0))
    assert robot.off_m(CORNERS) < 0.02


@pytest.mark.parametrize("lost", [(0.0, 0.0, 0.0), (0.1, 0.0, 0.05), (0.1, 0.0, 0.0)])
def test_a_car_keeps_to_its_arcs_forwards_and_backwards(lost):
    tight = 1.0 / CAR.planned_radius_m
    path = car_path((0.0, 1.0), (tight, 0.5), (0.0, 0.5), (-tight, -0.6), (0.0, 0.7))
    robot = Driven(CAR, path, lost=lost).to_the_end()
    assert robot.tracker.waypoints_passed == len(path.yaws_rad)
    off = robot.pose.x_m - path.positions_m[-1, 0], robot.pose.y_m - path.positions_m[-1, 1]
    assert math.hypot(*off) < 0.03
    assert robot.off_m(path) < 0.03
    limit = 1.0 / CAR.min_turning_radius_m + 1e-9
    assert all(abs(t.turn_radps) <= limit * abs(t.forward_mps) for t in robot.twists)


@settings(max_examples=10)
@given(
    st.lists(
        st.tuples(st.floats(0.2, 1.5), st.floats(-2.5, 2.5), st.one_of(st.just(NAN), st.floats(-3.0, 3.0))),
        min_size=1,
        max_size=4,
    ),
    st.floats(0.0, 0.15),
    st.floats(0.0, 0.15),
)
def test_pure_pursuit_ends_on_any_way(steps, lost_way, lost_turn):
    positions, yaws, heading = [[0.0, 0.0]], [NAN], 0.0
    for length, bend, yaw in steps:
        heading += bend
        last = positions[-1]
        positions.append([last[0] + length * math.cos(heading), last[1] + length * math.sin(heading)])
        yaws.append(yaw)
    path = Path(positions_m=np.array(positions), yaws_rad=np.array(yaws))
    robot = Driven(ROUND, path, lost=(lost_way, 0.0, lost_turn)).to_the_end()
    assert robot.tracker.waypoints_passed == len(yaws)
    assert math.hypot(robot.pose.x_m - positions[-1][0], robot.pose.y_m - positions[-1][1]) < 0.03
    assert robot.off_m(path) < 0.03
    speeds = np.diff([0.0, *(twist.forward_mps for twist in robot.twists)]) / TICK_S
    assert speeds.max() <= 1.0 + 1e-6
    assert max(abs(twist.turn_radps) for twist in robot.twists) <= math.radians(60.0) + 1e-9


def test_a_robot_beside_its_path_comes_back_to_it():
    path = Path(positions_m=np.array([[0.0, 0.0], [2.0, 0.0]]), yaws_rad=np.array([NAN, NAN]))
    beside = GroundPose(x_m=0.0, y_m=0.045, yaw_rad=0.2)
    robot = Driven(ROUND, path, beside).to_the_end()
    assert abs(robot.pose.y_m) < 0.005


def test_three_looks_on_the_spot_are_a_full_turn():
    robot = Driven(ROUND, Path.full_turn(0.0, 0.0, 0.0)).to_the_end()
    turned = sum(twist.turn_radps for twist in robot.twists) * TICK_S
    assert turned == pytest.approx(2 * math.pi, abs=math.radians(1.0))
    assert math.hypot(robot.pose.x_m, robot.pose.y_m) == 0.0


@pytest.mark.parametrize(
    ("config", "path"),
    [
        (ROUND, Path(positions_m=np.array([[0.0, 0.0], [5.0, 0.0]]), yaws_rad=np.array([NAN, NAN]))),
        (ANY_WAY, Path(positions_m=np.array([[0.0, 0.0], [5.0, 0.0]]), yaws_rad=np.array([NAN, NAN]))),
        (CAR, car_path((0.0, 5.0))),
    ],
    ids=["differential", "holonomic", "ackermann"],
)
def test_braking_takes_the_way_that_the_brakes_need(config, path):
    robot = Driven(config, path)
    while robot.pose.x_m < 2.0:
        robot.tick()
    began_m, expected_s = robot.pose.x_m, robot.tracker.standing_in_s
    robot.tracker.brake()
    assert robot.tracker.arrived
    assert not robot.tracker.standing
    began_s = robot.time_s
    robot.to_the_end()
    assert robot.pose.x_m - began_m == pytest.approx(1.0 / (2 * BRAKING_MPS2), abs=0.03)
    assert expected_s == pytest.approx(1.0 / BRAKING_MPS2, abs=0.03)
    assert robot.time_s - began_s == pytest.approx(expected_s, abs=0.1)


def test_a_speed_limit_holds():
    path = Path(positions_m=np.array([[0.0, 0.0], [2.0, 0.0]]), yaws_rad=np.array([NAN, NAN]))
    for config in (ROUND, ANY_WAY):
        robot = Driven(config, path, limit_mps=0.3).to_the_end()
        assert max(twist.forward_mps for twist in robot.twists) <= 0.3 + 1e-9
    robot = Driven(ROUND, path)
    for _ in range(40):
        robot.tick()
    robot.tracker.limit_speed(0.2)
    robot.to_the_end()
    assert max(twist.forward_mps for twist in robot.twists[80:]) <= 0.2 + 1e-9


def test_a_path_for_another_place_is_refused():
    far = Path(positions_m=np.array([[0.3, 0.0], [1.0, 0.0]]), yaws_rad=np.array([NAN, NAN]))
    with pytest.raises(RobotError, match=r"begins 0\.30 m from the robot"):
        tracker_of(ROUND, far, ORIGIN, 1.0)
    broken = Path(positions_m=np.array([[0.0, 0.0], [NAN, 0.0]]), yaws_rad=np.array([NAN, NAN]))
    with pytest.raises(RobotError, match="not finite"):
        tracker_of(ANY_WAY, broken, ORIGIN, 1.0)
    with pytest.raises(RobotError, match="degrees from the robot's heading"):
        tracker_of(CAR, car_path((0.0, 1.0)), GroundPose(x_m=0.0, y_m=0.0, yaw_rad=1.0), 1.0)
