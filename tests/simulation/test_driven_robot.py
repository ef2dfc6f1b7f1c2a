"""A robot whose wheels slip and whose pose drifts, among obstacles, in simulated time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hgs_core.errors import ConfigError, RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.motion import GroundPose, Twist
from hgs_core.robot.path import Path
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.simulation.depth_holes import DepthHoles
from hgs_core.simulation.driven_robot import TICK_S, DrivenRobot
from hgs_core.simulation.pose_drift import PoseDrift
from hgs_core.simulation.wheel_slip import WheelSlip
from tests.robot.test_vehicles import car_path
from tests.scene.worlds import room, with_boxes

ROUND, ANY_WAY, CAR = DifferentialConfig(), HolonomicConfig(), AckermannConfig()
FREE = BodyObstacles(room((-10.0, 10.0), (-10.0, 10.0)), ROUND.height_m)
BLOCKED = BodyObstacles(with_boxes(((1.0, -0.5, 0.0), (1.5, 0.5, 0.8))), ROUND.height_m)
NAN = math.nan
AHEAD = Path(positions_m=np.array([[0.0, 0.0], [3.0, 0.0]]), yaws_rad=np.array([NAN, 1.0]))
ROUND_TRIP = Path(
    positions_m=np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]]),
    yaws_rad=np.array([NAN, NAN, 0.5, NAN, 0.0]),
)


def driven(config=ROUND, obstacles=FREE, *, slip=0.0, drift=(0.0, 0.0), seed=1):
    seeds = np.random.SeedSequence(seed).spawn(2)
    track_m = 0.4 if isinstance(config, DifferentialConfig) else None
    return DrivenRobot(
        config,
        obstacles,
        StartPose(x_m=0.0, y_m=0.0, yaw_rad=0.0),
        slip=WheelSlip(slip, track_m, np.random.default_rng(seeds[0])),
        drift=PoseDrift(*drift, np.random.default_rng(seeds[1])),
    )


def live(robot, path, limit_s=60.0):
    robot.follow(path)
    while not robot.moment.standing:
        robot.advance(0.1)
        assert robot.state.timestamp_s < limit_s
    return robot.moment


@pytest.mark.parametrize(
    ("config", "path"),
    [(ROUND, ROUND_TRIP), (ANY_WAY, ROUND_TRIP), (CAR, car_path((0.0, 1.0), (1.5, 1.0), (-1.5, 1.0)))],
    ids=["differential", "holonomic", "ackermann"],
)
@pytest.mark.parametrize("slip", [0.0, 0.1])
def test_it_ends_where_its_path_ends(config, path, slip):
    moment = live(driven(config, slip=slip), path)
    end = path.positions_m[-1]
    assert math.hypot(moment.state.x_m - end[0], moment.state.y_m - end[1]) < 0.03
    assert moment.waypoints_passed == len(path.yaws_rad)
    assert moment.arrived
    assert moment.state.collisions == 0


def test_the_same_seed_gives_the_same_motion_however_time_is_cut():
    one, other, third = (driven(slip=0.2, drift=(2.0, 1.0), seed=seed) for seed in (1, 1, 2))
    for robot in (one, other, third):
        robot.follow(ROUND_TRIP)
    for _ in range(40):
        one.advance(0.11)
    other.advance(4.4)
    third.advance(4.4)
    assert one.moment == other.moment
    assert third.moment != other.moment


def test_the_controller_acts_on_the_estimate():
    moment = live(driven(drift=(5.0, 3.0)), ROUND_TRIP)
    assert math.hypot(moment.estimate.x_m, moment.estimate.y_m) < 0.03, "where it believes to be"
    assert math.hypot(moment.state.x_m, moment.state.y_m) > 0.05, "where it truly is"


def test_drift_grows_as_it_is_stated():
    errors = []
    for seed in range(150):
        drift = PoseDrift(2.0, 0.0, np.random.default_rng(seed))
        estimate = pose = GroundPose(x_m=0.0, y_m=0.0, yaw_rad=0.0)
        for k in range(1, 51):
            after = GroundPose(x_m=0.08 * k, y_m=0.0, yaw_rad=0.0)
            estimate, pose = drift.moved(estimate, pose, after), after
        errors.append((estimate.x_m - 4.0, estimate.y_m))
    # 2 % after one metre: 4 cm after four. 150 draws give the spread to 6 %.
    np.testing.assert_allclose(np.std(errors, axis=0), 0.04, rtol=0.2)


def test_turning_on_the_spot_does_not_drift():
    drift = PoseDrift(5.0, 5.0, np.random.default_rng(0))
    at, turned = (GroundPose(x_m=1.0, y_m=2.0, yaw_rad=yaw) for yaw in (0.0, 1.0))
    assert drift.moved(at, at, turned) == turned


def test_slip_takes_away_and_never_adds():
    slip = WheelSlip(0.3, None, np.random.default_rng(0))
    shares = [slip.applied(Twist(forward_mps=1.0), TICK_S).forward_mps for _ in range(5000)]
    assert 0.7 <= min(shares) < 0.75
    assert 0.95 < max(shares) <= 1.0
    assert np.mean(shares) == pytest.approx(0.85, abs=0.03)
    none = WheelSlip(0.0, 0.4, np.random.default_rng(0))
    assert none.applied(Twist(forward_mps=1.0, turn_radps=0.5), TICK_S) == Twist(
        forward_mps=1.0, turn_radps=0.5
    )


def test_a_contact_is_with_the_true_pose():
    robot = driven(obstacles=BLOCKED)
    moment = live(robot, AHEAD)
    assert (moment.state.collisions, moment.arrived, moment.waypoints_passed) == (1, True, 1)
    assert moment.state.x_m == pytest.approx(1.0 - ROUND.radius_m, abs=0.01)


def test_stop_brakes_and_a_new_path_waits_for_the_stand():
    robot = driven()
    robot.follow(AHEAD)
    robot.advance(1.5)
    began_m = robot.state.x_m
    robot.stop()
    assert robot.arrived
    assert not robot.moment.standing
    with pytest.raises(RobotError, match="stop it"):
        robot.follow(AHEAD)
    robot.advance(robot.standing_in_s + 0.1)
    assert robot.moment.standing
    assert robot.state.x_m - began_m == pytest.approx(1.0 / 3.0, abs=0.03)
    with pytest.raises(RobotError, match="begins"):
        robot.follow(AHEAD)
    robot.follow(Path.empty())
    assert robot.arrived


def test_a_moment_is_remembered_by_its_time():
    robot = driven(drift=(5.0, 3.0))
    robot.follow(AHEAD)
    then = [robot.tick() for _ in range(100)]
    for moment in then:
        assert robot.moment_at(moment.state.timestamp_s) == moment
    with pytest.raises(RobotError, match=r"nothing is known of 2\.02 s"):
        robot.moment_at(2.02)


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_holes_cover_their_share(share):
    holes = DepthHoles(share, np.random.default_rng(3))
    depth = np.full((170, 300), 2.0, dtype=np.float32)
    covered = [float(np.mean(holes.punched(depth) == 0.0)) for _ in range(60)]
    assert np.mean(covered) == pytest.approx(share, abs=0.03)
    again = DepthHoles(share, np.random.default_rng(3))
    np.testing.assert_array_equal(
        again.punched(depth), DepthHoles(share, np.random.default_rng(3)).punched(depth)
    )


def test_shares_that_are_none_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(ConfigError, match="depth holes 1"):
        DepthHoles(1.0, rng)
    with pytest.raises(ConfigError, match=r"wheel slip -0\.1"):
        WheelSlip(-0.1, None, rng)
    with pytest.raises(ConfigError, match="pose drift of -1"):
        PoseDrift(-1.0, 0.0, rng)
