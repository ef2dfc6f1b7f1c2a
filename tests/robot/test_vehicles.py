"""What a path takes each vehicle: speeds under all limits, times, braking, and keeping to it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.errors import ConfigError, RobotError
from hgs_core.robot.ackermann import Ackermann, AckermannConfig, driven_arcs
from hgs_core.robot.differential import Differential, DifferentialConfig
from hgs_core.robot.holonomic import Holonomic, HolonomicConfig
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState
from hgs_core.robot.speed_profile import speeds_along, times_along
from hgs_core.robot.timed_path import PathPose
from hgs_core.robot.tracking import steered_curvature
from hgs_core.robot.vehicle import Vehicle, robot_config, vehicle_of

NAN = float("nan")
CAR = AckermannConfig()


def car_path(*pieces: tuple[float, float], step_m: float = 0.05) -> Path:
    """Pieces of (curvature, signed length) from the origin, heading along +x; a view at the end."""
    rows = [(0.0, 0.0, 0.0)]
    for curvature, length in pieces:
        n = max(2, math.ceil(abs(length) / step_m))
        for _ in range(n):
            x, y, yaw = rows[-1]
            d = length / n
            after = yaw + curvature * d
            if curvature:
                dx, dy = (
                    (math.sin(after) - math.sin(yaw)) / curvature,
                    (math.cos(yaw) - math.cos(after)) / curvature,
                )
            else:
                dx, dy = d * math.cos(yaw), d * math.sin(yaw)
            rows.append((x + dx, y + dy, after))
    table = np.array(rows)
    yaws = np.full(len(table), np.nan)
    yaws[-1] = table[-1, 2]
    return Path(positions_m=table[:, :2], yaws_rad=yaws, headings_rad=table[:, 2])


def test_a_straight_is_a_trapezoid_by_hand():
    # 1 m/s reached after 0.5 m (1 s), lost over 1/3 m (2/3 s), 7/6 m between: 2 m in 1 + 7/6 + 2/3 s.
    timed = Ackermann(CAR).timed(car_path((0.0, 2.0), step_m=0.01), 0.0)
    assert timed.duration_s == pytest.approx(1.0 + 7 / 6 + 2 / 3, abs=0.01)
    assert timed.at(1.5).speed_mps == pytest.approx(1.0)
    assert timed.at(0.5).x_m == pytest.approx(0.125, abs=1e-3)
    assert (timed.at(99.0).x_m, timed.at(99.0).speed_mps) == (pytest.approx(2.0), 0.0)


@given(
    st.lists(st.floats(0.02, 0.5), min_size=2, max_size=20),
    st.integers(0, 1000),
    st.floats(0.2, 3.0),
    st.floats(0.2, 3.0),
)
def test_speeds_keep_every_limit(lengths, seed, acceleration, braking):
    lengths_m = np.array(lengths)
    limits = np.random.default_rng(seed).uniform(0.05, 1.0, len(lengths) + 1)
    limits[[0, -1]] = 0.0
    speeds = speeds_along(lengths_m, limits, acceleration_mps2=acceleration, braking_mps2=braking)
    assert np.all(speeds <= limits + 1e-12)
    change = np.diff(speeds**2) / (2.0 * lengths_m)
    assert np.all(change <= acceleration + 1e-9)
    assert np.all(-change <= braking + 1e-9)
    left = np.cumsum(lengths_m[::-1])[::-1]
    assert np.all(speeds[:-1] ** 2 / (2 * braking) <= left + 1e-9), (
        "it can always stand before the path's end"
    )
    assert np.all(times_along(lengths_m, speeds) > 0.0)


def test_a_car_slows_down_in_curves_drives_back_slowly_and_stands_at_a_change_of_gear():
    tightest = 1.0 / CAR.min_turning_radius_m
    path = car_path((0.0, 2.0), (tightest, 1.0), (-tightest, -0.4), (0.0, -1.0))
    timed = Ackermann(CAR).timed(path, 0.0)
    gears, lengths, curvatures = driven_arcs(path.positions_m, path.headings_rad)
    assert lengths.sum() == pytest.approx(4.4)
    assert np.abs(curvatures).max() == pytest.approx(tightest)
    assert np.count_nonzero(gears < 0) == np.count_nonzero(timed.speed_mps < 0) + 1
    assert timed.speed_mps.min() >= -CAR.max_reverse_speed_mps
    lateral = timed.speed_mps[:-1] ** 2 * np.abs(timed.curvature_1pm[:-1])
    assert lateral.max() <= CAR.max_lateral_acceleration_mps2 + 1e-9
    assert timed.at(timed.t_s[int(timed.at_waypoint[60])]).speed_mps == 0.0  # 40 + 20 waypoints in
    ends = timed.at(timed.duration_s)
    np.testing.assert_allclose([ends.x_m, ends.y_m], path.positions_m[-1])


def test_between_samples_the_car_is_on_the_arc():
    curvature = 1.0 / CAR.min_turning_radius_m
    timed = Ackermann(CAR).timed(car_path((curvature, 1.2), step_m=0.3), 0.0)
    for t in np.linspace(0.0, timed.duration_s, 50).tolist():
        at = timed.at(t)
        assert math.hypot(at.x_m, at.y_m - 1 / curvature) == pytest.approx(1 / curvature, abs=1e-9)
        assert at.yaw_rad == pytest.approx(curvature * timed.driven_m(t), abs=1e-9)


@pytest.mark.parametrize("t", [0.0, 0.4, 1.3, 2.2, 3.0])
def test_braking_stays_on_the_path_and_takes_the_stopping_distance(t):
    curvature = 1.0 / CAR.planned_radius_m
    timed = Ackermann(CAR).timed(car_path((0.0, 1.0), (curvature, 1.0), (0.0, 1.0)), 0.0)
    here, braking = timed.at(t), timed.braking_from(t, CAR.max_braking_mps2)
    assert braking.duration_s == pytest.approx(here.speed_mps / CAR.max_braking_mps2, abs=1e-6)
    assert braking.driven_m(99.0) == pytest.approx(here.speed_mps**2 / 2 / CAR.max_braking_mps2, abs=1e-6)
    ends = braking.at(99.0)
    assert ends.speed_mps == 0.0
    along = [timed.at(s) for s in np.linspace(t, timed.duration_s, 4000).tolist()]
    assert min(math.hypot(p.x_m - ends.x_m, p.y_m - ends.y_m) for p in along) < 1e-3


@given(st.floats(-0.05, 0.05), st.floats(-0.3, 0.3), st.sampled_from([1.0, -1.0]))
def test_a_car_off_its_path_comes_back_in_either_gear(aside, off, gear):
    x, y, yaw = 0.0, aside, off
    limit = 1.0 / CAR.min_turning_radius_m
    for k in range(150):  # 1.5 m
        wanted = PathPose(x_m=gear * 0.01 * k, y_m=0.0, yaw_rad=0.0, speed_mps=gear, curvature_1pm=0.0)
        curvature = steered_curvature(x, y, yaw, wanted, reversing=gear < 0, limit_1pm=limit)
        assert abs(curvature) <= limit
        x, y = x + gear * 0.01 * math.cos(yaw), y + gear * 0.01 * math.sin(yaw)
        yaw += curvature * gear * 0.01
    assert abs(y) < 0.005
    assert abs(yaw) < 0.03


def test_a_differential_robot_takes_the_times_that_it_is_simulated_with():
    # As in tests/simulation/test_robot.py: 1.5 s of turning, 2 s of driving, 1.5 s of turning.
    path = Path(positions_m=np.array([[0.0, 0.0], [0.0, 2.0]]), yaws_rad=np.array([NAN, np.pi]))
    timed = Differential(DifferentialConfig()).timed(path, 0.0)
    assert timed.duration_s == pytest.approx(5.0)
    assert timed.at(2.5).y_m == pytest.approx(1.0)
    assert timed.at(1.0).yaw_rad == pytest.approx(np.radians(60.0))
    assert timed.t_s[timed.at_waypoint].tolist() == pytest.approx([0.0, 5.0])


def test_a_holonomic_robot_turns_while_it_drives_and_waits_for_its_turn():
    config = HolonomicConfig()
    path = Path(
        positions_m=np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.1, 1.0]]),
        yaws_rad=np.array([NAN, NAN, np.pi / 2, -np.pi / 2]),
    )
    timed = Holonomic(config).timed(path, 0.0)
    first, corner, view, last = timed.t_s[timed.at_waypoint].tolist()
    assert first == 0.0
    assert timed.at(corner / 2).yaw_rad == pytest.approx(np.radians(60.0) * corner / 2, abs=0.02)
    assert timed.at(view).yaw_rad == pytest.approx(np.pi / 2)
    assert timed.at(corner).speed_mps == pytest.approx(config.corner_change_mps / math.sqrt(2.0))
    assert timed.at(view).speed_mps == 0.0
    assert last - view == pytest.approx(3.0), "half a turn takes longer than the 10 cm"


def test_vehicles_by_name_and_their_first_looks():
    state = RobotState(x_m=1.0, y_m=2.0, yaw_rad=0.3, timestamp_s=0.0, path_length_m=0.0, collisions=0)
    for drive in ("differential", "holonomic", "ackermann"):
        vehicle = vehicle_of(robot_config({"drive": drive}))
        assert isinstance(vehicle, Vehicle)
        assert vehicle.config.drive == drive
        assert len(vehicle.first_look(state).yaws_rad) == (0 if drive == "ackermann" else 3)
    assert robot_config({}).drive == "differential"
    with pytest.raises(ConfigError, match=r"robot.drive = 'tracked': must be one of differential"):
        robot_config({"drive": "tracked"})


def test_a_car_refuses_a_path_without_headings():
    path = Path(positions_m=np.array([[0.0, 0.0], [1.0, 0.0]]), yaws_rad=np.array([NAN, 0.0]))
    with pytest.raises(RobotError, match="heading at every waypoint"):
        Ackermann(CAR).timed(path, 0.0)
