"""The simulated car and the simulated holonomic robot among obstacles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgs_core.errors import RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.path import Path
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.footprint import Rectangle
from hgs_core.simulation.vehicle import SimulatedVehicle
from tests.robot.test_vehicles import car_path
from tests.scene.worlds import room, with_boxes

CAR = AckermannConfig()
FREE = BodyObstacles(room((-10.0, 10.0), (-10.0, 10.0)), CAR.height_m)
BLOCKED = BodyObstacles(with_boxes(((1.0, -0.5, 0.0), (1.5, 0.5, 0.8))), CAR.height_m)
TIGHT = 1.0 / CAR.planned_radius_m
WAY = car_path((0.0, 1.0), (TIGHT, 0.8), (-TIGHT, 0.5), (TIGHT, -0.6), (0.0, 0.7))


def car_at(x=0.0, y=0.0, yaw=0.0, obstacles=FREE):
    return SimulatedVehicle(CAR, obstacles, StartPose(x_m=x, y_m=y, yaw_rad=yaw))


def from_here(robot, path):
    """A path that begins at the origin, moved to where the robot stands (heading along +x)."""
    here = np.array([robot.state.x_m, robot.state.y_m])
    return Path(positions_m=path.positions_m + here, yaws_rad=path.yaws_rad, headings_rad=path.headings_rad)


def drive(robot, limit_s=60.0, step_s=0.4):
    while not robot.arrived and robot.state.timestamp_s < limit_s:
        robot.advance(step_s)
    return robot.state


def test_a_car_keeps_to_its_path():
    robot = car_at()
    robot.follow(WAY)
    state = drive(robot)
    assert math.hypot(state.x_m - WAY.positions_m[-1, 0], state.y_m - WAY.positions_m[-1, 1]) < 0.005
    assert state.yaw_rad == pytest.approx(WAY.headings_rad[-1], abs=0.01)
    assert state.path_length_m == pytest.approx(3.6, abs=0.02)
    assert robot.waypoints_passed == len(WAY.yaws_rad)
    assert state.collisions == 0


def test_a_car_that_begins_beside_its_path_ends_on_it():
    robot = car_at(x=0.02, y=0.05, yaw=0.1)
    robot.follow(WAY)
    state = drive(robot)
    assert math.hypot(state.x_m - WAY.positions_m[-1, 0], state.y_m - WAY.positions_m[-1, 1]) < 0.03


@settings(max_examples=8)
@given(st.lists(st.floats(0.001, 1.5), min_size=1, max_size=4))
def test_how_time_is_cut_does_not_matter(steps):
    one, other = car_at(), car_at()
    for robot in (one, other):
        robot.follow(WAY)
    for step in steps:
        one.advance(step)
    other.advance(sum(steps))
    np.testing.assert_allclose(
        [one.state.x_m, one.state.y_m, one.state.yaw_rad],
        [other.state.x_m, other.state.y_m, other.state.yaw_rad],
        atol=1e-9,
    )


def test_told_to_stop_it_brakes_on_its_path():
    robot = car_at()
    robot.follow(car_path((0.0, 3.0)))
    before = robot.advance(1.5)
    standing_in = robot.standing_in_s
    assert standing_in == pytest.approx(1.0 / CAR.max_braking_mps2, abs=1e-6)
    robot.stop()
    assert robot.arrived
    with pytest.raises(RobotError, match="stop it"):
        robot.follow(car_path((0.0, 1.0)))
    state = robot.advance(standing_in)
    assert robot.standing_in_s == pytest.approx(0.0, abs=1e-9)
    assert state.x_m - before.x_m == pytest.approx(1.0 / 2 / CAR.max_braking_mps2, abs=1e-3)
    assert robot.advance(1.0).x_m == state.x_m


def test_a_contact_is_counted_once_and_the_car_can_back_out():
    robot = car_at(obstacles=BLOCKED)
    robot.follow(car_path((0.0, 2.0)))
    state = drive(robot)
    assert (state.collisions, robot.arrived) == (1, True)
    assert state.x_m + CAR.front_m == pytest.approx(1.0, abs=0.01)
    robot.follow(from_here(robot, car_path((0.0, 0.5))))
    robot.advance(0.5)
    assert robot.state.collisions == 1, "pushing on is the same contact"
    robot.follow(from_here(robot, car_path((0.0, -0.5))))
    state = drive(robot)
    assert state.reversing
    assert state.x_m + CAR.front_m == pytest.approx(0.5, abs=0.01)
    assert state.collisions == 1


@given(st.floats(-1.0, 2.5), st.floats(-1.5, 1.5), st.floats(-np.pi, np.pi))
def test_a_rectangles_room_against_its_points(x, y, yaw):
    body = Rectangle(rear_m=0.1, front_m=0.38, half_width_m=0.18)
    u, v = np.meshgrid(np.linspace(-0.1, 0.38, 25), np.linspace(-0.18, 0.18, 19))
    cos, sin = np.cos(yaw), np.sin(yaw)
    points = np.stack([x + u * cos - v * sin, y + u * sin + v * cos], axis=-1)
    least = float(BLOCKED.clearance_m(points).min())
    room_m = body.room_m(BLOCKED, x, y, yaw)
    assert room_m <= least + 1e-5
    if least > 0.02:
        assert room_m > 0.0


def test_snapshots_continue_exactly():
    one, other = car_at(), car_at()
    one.follow(WAY)
    one.advance(1.234)
    other.restore(one.snapshot())
    for robot in (one, other):
        robot.advance(0.777)
    assert one.state == other.state
    assert one.snapshot() == other.snapshot()


def test_a_holonomic_robot_is_where_its_timed_path_says():
    config = HolonomicConfig()
    robot = SimulatedVehicle(config, FREE, StartPose(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    path = Path(
        positions_m=np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
        yaws_rad=np.array([np.nan, np.nan, np.pi / 2]),
    )
    robot.follow(path)
    state = drive(robot)
    assert (state.x_m, state.y_m) == (pytest.approx(1.0), pytest.approx(1.0))
    assert state.yaw_rad == pytest.approx(np.pi / 2)
    assert state.path_length_m == pytest.approx(2.0, abs=1e-3)
