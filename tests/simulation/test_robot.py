import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.errors import RobotError
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.path import Path
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.robot import SimulatedRobot
from tests.scene.worlds import room, with_boxes

NAN = float("nan")
CONFIG = DifferentialConfig()
FREE = BodyObstacles(room((-10.0, 10.0), (-10.0, 10.0)), CONFIG.height_m)
BLOCKED = BodyObstacles(
    with_boxes(
        ((1.0, -0.5, 0.0), (1.5, 0.5, 0.8)),
        ((-1.5, -0.5, 0.0), (-1.0, 0.5, 0.02)),
        ((-1.0, 1.0, 1.2), (0.0, 1.5, 2.0)),
    ),
    CONFIG.height_m,
)


def robot_at(x=0.0, y=0.0, yaw=0.0, obstacles=FREE):
    return SimulatedRobot(CONFIG, obstacles, StartPose(x_m=x, y_m=y, yaw_rad=yaw))


def path(*waypoints):
    """Waypoints (x, y, yaw)."""
    table = np.array(waypoints, dtype=float)
    return Path(positions_m=table[:, :2], yaws_rad=table[:, 2])


def drive(robot, limit_s=60.0):
    """Advances in steps of a frame until the robot has arrived."""
    while not robot.arrived and robot.state.timestamp_s < limit_s:
        robot.advance(0.4)
    return robot.state


def test_times_and_lengths_of_a_path_by_hand():
    # Turn 90 degrees (1.5 s), drive 2 m (2 s), turn to yaw pi = 90 degrees further (1.5 s): 5 s in all.
    robot = robot_at()
    robot.follow(path((0, 0, NAN), (0, 2, np.pi)))
    state = robot.advance(1.5)
    assert state.yaw_rad == pytest.approx(np.pi / 2)
    assert (state.x_m, state.y_m, robot.waypoints_passed) == (0.0, 0.0, 1)
    state = robot.advance(1.0)
    assert state.y_m == pytest.approx(1.0)
    state = robot.advance(1.0)
    assert (state.y_m, robot.waypoints_passed) == (pytest.approx(2.0), 1)
    state = robot.advance(1.499)
    assert not robot.arrived
    state = robot.advance(0.002)
    assert robot.arrived
    assert robot.waypoints_passed == 2
    assert state.yaw_rad == pytest.approx(np.pi)
    assert state.path_length_m == pytest.approx(2.0)
    assert state.timestamp_s == pytest.approx(5.001)
    assert state.collisions == 0


def test_the_shorter_turn_is_taken():
    robot = robot_at(yaw=np.deg2rad(170))
    robot.follow(path((0, 0, np.deg2rad(-170))))
    state = robot.advance(20 / 60 - 1e-6)
    assert not robot.arrived
    assert abs(state.yaw_rad) > np.deg2rad(169)
    robot.advance(2e-6)
    assert robot.arrived


@given(st.lists(st.floats(0.001, 1.5), min_size=1, max_size=12), st.integers(0, 1000))
def test_how_time_is_cut_does_not_matter(steps, seed):
    rng = np.random.default_rng(seed)
    stops = [
        (0, 0, NAN),
        *((*rng.uniform(-3, 3, 2), rng.choice([NAN, rng.uniform(-3, 3)])) for _ in range(4)),
    ]
    whole, parts = robot_at(), robot_at()
    whole.follow(path(*stops))
    parts.follow(path(*stops))
    whole.advance(sum(steps))
    for step in steps:
        parts.advance(step)
    a, b = whole.state, parts.state
    np.testing.assert_allclose([a.x_m, a.y_m, a.path_length_m], [b.x_m, b.y_m, b.path_length_m], atol=1e-7)
    assert abs(np.angle(np.exp(1j * (a.yaw_rad - b.yaw_rad)))) < 1e-7
    assert a.timestamp_s == pytest.approx(b.timestamp_s)


@given(st.integers(0, 2**32 - 1))
def test_the_body_never_enters_an_obstacle_and_never_outruns_its_speed(seed):
    rng = np.random.default_rng(seed)
    robot = robot_at(-0.5, -1.2, obstacles=BLOCKED)
    before = robot.state
    for _ in range(12):
        if robot.arrived:
            here = robot.state
            goal = (*rng.uniform([-2.9, -1.9], [2.9, 1.9]), NAN)
            robot.follow(path((here.x_m, here.y_m, NAN), goal))
        state = robot.advance(0.4)
        moved = np.hypot(state.x_m - before.x_m, state.y_m - before.y_m)
        assert moved <= 0.4 * CONFIG.max_speed_mps + 1e-9
        assert BLOCKED.clearance_m(np.array([state.x_m, state.y_m])) > CONFIG.radius_m - 1e-5
        before = state


def test_a_contact_stops_the_robot_before_the_obstacle_and_counts_once():
    robot = robot_at(obstacles=BLOCKED)
    robot.follow(path((0, 0, NAN), (2, 0, NAN)))
    state = drive(robot)
    assert robot.arrived
    assert robot.waypoints_passed == 1
    assert state.collisions == 1
    # The block begins at x = 1: the axis stops within a check step of 5 mm before 0.75.
    assert 0.744 < state.x_m < 0.75
    robot.follow(path((state.x_m, 0, NAN), (2, 0, NAN)))
    assert drive(robot).collisions == 1  # still the same contact
    robot.follow(path((robot.state.x_m, 0, NAN), (0, 0, NAN), (2, 0, NAN)))
    assert drive(robot).collisions == 2


def test_rugs_and_what_hangs_above_the_body_are_no_obstacles():
    robot = robot_at(0.0, 0.0, np.pi, obstacles=BLOCKED)
    robot.follow(path((0, 0, NAN), (-2, 0, NAN)))
    assert drive(robot).x_m == pytest.approx(-2.0)
    robot.follow(path((-2, 0, NAN), (-2, 1.25, NAN), (1, 1.25, NAN)))
    assert drive(robot).x_m == pytest.approx(1.0)
    assert robot.state.collisions == 0


def test_a_graze_that_clears_the_corner_is_no_contact():
    robot = robot_at(0.0, -0.7501 - 0.0, 0.0, obstacles=BLOCKED)
    robot.follow(path((0, -0.7501, NAN), (2.5, -0.7501, NAN)))
    assert drive(robot).collisions == 0
    assert robot.state.x_m == pytest.approx(2.5)


def test_a_robot_that_stands_too_close_may_leave():
    robot = robot_at(0.8, 0.0, np.pi, obstacles=BLOCKED)  # 5 cm inside its clearance
    robot.follow(path((0.8, 0, NAN), (0, 0, NAN)))
    assert drive(robot).x_m == pytest.approx(0.0)
    assert robot.state.collisions == 0


def test_following_and_stopping():
    robot = robot_at()
    assert robot.arrived
    robot.follow(Path.empty())
    assert robot.arrived
    robot.follow(path((0, 0, NAN), (1, 0, NAN)))
    robot.advance(0.5)
    robot.stop()
    assert robot.arrived
    assert robot.advance(1.0).x_m == pytest.approx(0.5)
    assert robot.state.timestamp_s == pytest.approx(1.5)
    robot.follow(path((0.5 + 0.04, 0.0, NAN), (1.5, 0.0, NAN)))  # begins within 5 cm: no detour to it
    robot.advance(0.0)
    assert robot.waypoints_passed == 1


def test_impossible_commands_are_refused():
    robot = robot_at()
    with pytest.raises(RobotError, match=r"begins 1\.00 m from the robot"):
        robot.follow(path((1, 0, NAN), (2, 0, NAN)))
    with pytest.raises(RobotError, match="not finite"):
        robot.follow(path((0, 0, NAN), (NAN, 0, NAN)))
    with pytest.raises(RobotError, match="cannot advance by -1"):
        robot.advance(-1.0)
    with pytest.raises(RobotError, match="obstacles are for a body of"):
        SimulatedRobot(DifferentialConfig(height_m=0.5), FREE, StartPose(x_m=0.0, y_m=0.0, yaw_rad=0.0))


def test_a_restored_robot_goes_on_as_the_first_would_have():
    stops = path((0, 0, NAN), (0, 1, 1.0), (-2, 1, NAN), (-2, -1.5, 0.3))
    first = robot_at(obstacles=BLOCKED)
    first.follow(stops)
    first.advance(3.3)
    second = robot_at(1.9, 1.5, obstacles=BLOCKED)
    second.restore(first.snapshot())
    assert second.state == first.state
    for _ in range(20):
        assert first.advance(0.4) == second.advance(0.4)
    assert second.arrived == first.arrived
    assert second.waypoints_passed == first.waypoints_passed
