"""Odometries along known paths in a simulated room."""

import math

import numpy as np
import pytest

from hgs_core.errors import ConfigError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation import lidar_odometry
from hgs_core.localisation.depth_agreement import depth_agreement
from hgs_core.localisation.lidar_odometry import LidarOdometry, LidarOdometryConfig, Mounting
from hgs_core.localisation.localiser import LocalisationConfig, Localiser, Located, Lost
from hgs_core.localisation.methods import build_localiser, localisation_config, localisation_methods
from hgs_core.localisation.rgbd_odometry import RgbdOdometry, RgbdOdometryConfig
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.lidar import LidarConfig
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame
from hgs_core.simulation.lidar import SimulatedLidar
from tests.scene.worlds import with_boxes

CAMERA = CameraIntrinsics.centred(160, 100, 90.0)
INTERVAL_S = 0.2


@pytest.fixture(scope="module")
def caster() -> RayCaster:
    return RayCaster(
        with_boxes(
            ((1.0, -0.5, 0.0), (1.6, 0.4, 1.2)),
            ((-2.4, 0.8, 0.0), (-1.6, 1.6, 1.8)),
            ((2.0, 1.0, 0.6), (2.8, 1.9, 1.5)),
            ((-1.0, -1.9, 0.3), (-0.4, -1.4, 1.6)),
        )
    )


def pose_at(time_s: float) -> SE3:
    """On a circle of 0.6 m, at 0.2 m/s, looking ahead on it, at the boxes."""
    angle = 0.33 * time_s
    return level_camera_pose(0.6 * math.cos(angle) - 0.6, 0.6 * math.sin(angle), 1.0, angle + 0.2)


def frame_at(caster: RayCaster, time_s: float, pose: SE3 | None = None) -> AlignedFrame:
    rgb, depth = caster.render(CAMERA, pose or pose_at(time_s), 5.0)
    noise = np.random.default_rng(round(10 * time_s)).uniform(-0.02, 0.02, depth.shape)
    return AlignedFrame(
        rgb=rgb,
        depth_m=np.where(np.isfinite(depth), depth + noise, depth).astype(np.float32),
        intrinsics=CAMERA,
        T_world_camera=None,
        timestamp_s=time_s,
        sequence=round(time_s / INTERVAL_S),
    )


def error_m(answer: Located | Lost, true: SE3) -> float:
    assert isinstance(answer, Located), answer
    return float(np.linalg.norm(answer.T_world_camera.translation - true.translation))


@pytest.mark.parametrize("residual", ["hybrid", "point-to-plane"])
def test_rgbd_odometry_follows_the_camera(caster: RayCaster, residual: str) -> None:
    config = RgbdOdometryConfig.model_validate({"residual": residual, "max_width_px": 160})
    localiser = RgbdOdometry(config, pose_at(0.0))
    assert isinstance(localiser, Localiser)
    times = INTERVAL_S * np.arange(12)
    errors = [error_m(localiser.locate(frame_at(caster, t)), pose_at(t)) for t in times]
    assert errors[0] == 0.0
    assert max(errors) < 0.03  # over 0.4 m and 42 degrees, with 2 cm of noise on each depth


def test_a_frame_that_shows_something_else_is_lost_and_the_next_is_found_again(caster: RayCaster) -> None:
    localiser = RgbdOdometry(RgbdOdometryConfig(max_width_px=160), pose_at(0.0))
    for k in range(3):
        localiser.locate(frame_at(caster, k * INTERVAL_S))
    behind = level_camera_pose(-0.2, -0.5, 1.0, math.pi)
    answer = localiser.locate(frame_at(caster, 0.6, behind))
    assert isinstance(answer, Lost)
    assert "frame 3 fits nowhere near the last one" in answer.reason
    assert error_m(localiser.locate(frame_at(caster, 0.8)), pose_at(0.8)) < 0.02


def test_frames_without_depth_or_out_of_order_are_lost(caster: RayCaster) -> None:
    localiser = RgbdOdometry(RgbdOdometryConfig(), pose_at(0.0))
    blind = frame_at(caster, 0.0)
    blind.depth_m[:] = 0.0
    answer = localiser.locate(blind)
    assert isinstance(answer, Lost)
    assert "no depth within 5.0 m" in answer.reason
    localiser.locate(frame_at(caster, 0.4))
    again = localiser.locate(frame_at(caster, 0.4))
    assert isinstance(again, Lost)
    assert "is not after" in again.reason


def test_depths_agree_where_the_pose_is_right(caster: RayCaster) -> None:
    _, here = caster.render(CAMERA, pose_at(0.0), 5.0)
    _, there = caster.render(CAMERA, pose_at(1.0), 5.0)
    T_there_here = pose_at(1.0).inverse() @ pose_at(0.0)
    gates = {"gate_m": 0.03, "gate_slope": 0.0, "other_camera": CAMERA}
    right = depth_agreement(here, there, CAMERA, T_there_here, **gates)
    assert 0.6 < right.overlap < 1.0
    assert right.fitness > 0.9
    assert right.inlier_rmse_m < 0.01
    wrong = depth_agreement(here, there, CAMERA, SE3.identity(), **gates)
    assert wrong.fitness < 0.6
    away = SE3(rotation=np.diag([-1.0, 1.0, -1.0]), translation=np.zeros(3))
    assert depth_agreement(here, there, CAMERA, away, **gates).overlap == 0.0


def scan_at(lidar: SimulatedLidar, config: LidarOdometryConfig, time_s: float) -> PointScan:
    return lidar.scan(pose_at(time_s) @ config.T_lidar_camera().inverse(), time_s)


def test_lidar_odometry_follows_the_camera_between_scans_and_a_little_beyond(caster: RayCaster) -> None:
    config = LidarOdometryConfig(camera_xyz_m=(0.1, 0.0, -0.2), camera_rpy_deg=(0.0, 5.0, 10.0))
    lidar = SimulatedLidar(caster, LidarConfig(azimuth_step_deg=1.0), np.random.default_rng(0))
    localiser = LidarOdometry(config, pose_at(0.0))
    assert isinstance(localiser, Localiser)
    assert isinstance(localiser.locate(frame_at(caster, 0.0)), Lost)
    errors = []
    for k in range(21):
        localiser.take_scan(scan_at(lidar, config, 0.1 * k))
        if k >= 1:
            for time_s in (0.1 * k - 0.04, 0.1 * k + 0.05):
                blank = frame_at(caster, 0.0)
                asked = AlignedFrame(**{**vars(blank), "timestamp_s": time_s})
                errors.append(error_m(localiser.locate(asked), pose_at(time_s)))
    assert max(errors) < 0.05
    late = AlignedFrame(**{**vars(frame_at(caster, 0.0)), "timestamp_s": 2.4})
    answer = localiser.locate(late)
    assert isinstance(answer, Lost)
    assert "is 0.40 s older, at most 0.25 s is believed; no scan came since" in answer.reason


def test_a_scan_of_another_place_is_left_out(caster: RayCaster) -> None:
    config = LidarOdometryConfig()
    lidar = SimulatedLidar(caster, LidarConfig(azimuth_step_deg=1.0), np.random.default_rng(0))
    localiser = LidarOdometry(config, pose_at(0.0))
    for k in range(4):
        localiser.take_scan(scan_at(lidar, config, 0.1 * k))
    elsewhere = np.random.default_rng(0).uniform(-30, 30, (3000, 3)).astype(np.float32)
    for number, points in enumerate((elsewhere, elsewhere[:50])):
        localiser.take_scan(
            PointScan(points_m=points, T_world_lidar=None, timestamp_s=0.5 + number, sequence=9)
        )
    answer = localiser.locate(AlignedFrame(**{**vars(frame_at(caster, 0.0)), "timestamp_s": 1.5}))
    assert isinstance(answer, Lost)
    assert "scan 9 has 50 points, at least 100 are needed" in answer.reason
    localiser.take_scan(scan_at(lidar, config, 1.6))
    found = localiser.locate(AlignedFrame(**{**vars(frame_at(caster, 0.0)), "timestamp_s": 1.6}))
    assert error_m(found, pose_at(1.6)) < 0.08


def test_lidar_odometry_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lidar_odometry, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"needs kiss-icp: pip install 'hgs\[lidar\]'"):
        build_localiser(LidarOdometryConfig(), start=SE3.identity())


def test_a_level_camera_looks_along_the_lidars_x_axis() -> None:
    T = LidarOdometryConfig(camera_xyz_m=(0.1, 0.2, 0.3)).T_lidar_camera()
    np.testing.assert_allclose(T.apply(np.array([[0.0, 0.0, 1.0]])), [[1.1, 0.2, 0.3]], atol=1e-12)
    down = LidarOdometryConfig(camera_xyz_m=(0, 0, 0), camera_rpy_deg=(0, 90, 0)).T_lidar_camera()
    np.testing.assert_allclose(down.apply(np.array([[0.0, 0.0, 1.0]])), [[0, 0, -1]], atol=1e-12)


def test_a_mounting_is_told_as_its_settings_say_it() -> None:
    config = LidarOdometryConfig(camera_xyz_m=(0.1, -0.2, 0.3), camera_rpy_deg=(-10.0, 25.0, 170.0))
    told = Mounting.of(config.T_lidar_camera())
    np.testing.assert_allclose(told.camera_xyz_m, config.camera_xyz_m, atol=1e-12)
    np.testing.assert_allclose(told.camera_rpy_deg, config.camera_rpy_deg, atol=1e-9)


def test_methods_are_built_by_name() -> None:
    for method in localisation_methods():
        config = localisation_config({"method": method})
        assert config.method == method
        assert isinstance(build_localiser(config, start=SE3.identity()), Localiser)
    assert localisation_config({}).method == "given"
    with pytest.raises(ConfigError, match="method = 'gps': must be one of given, rgbd-odometry"):
        localisation_config({"method": "gps"})
    with pytest.raises(ConfigError, match="is of no method"):
        build_localiser(LocalisationConfig(method="given"), start=SE3.identity())
