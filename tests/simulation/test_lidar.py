"""The simulated lidar against a room whose walls are known."""

import numpy as np
import pytest

from hgs_core.errors import SensorError
from hgs_core.geometry.se3 import SE3
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.lidar import LidarConfig
from hgs_core.sensing.point_scan import PointScan
from hgs_core.simulation.lidar import SimulatedLidar, level_lidar_pose
from tests.scene.worlds import room

POSE = level_lidar_pose(0.5, -0.3, 1.2, 0.7)


@pytest.fixture(scope="module")
def caster() -> RayCaster:
    return RayCaster(room())


def lidar(caster: RayCaster, seed: int = 0, **settings) -> SimulatedLidar:
    return SimulatedLidar(caster, LidarConfig(**settings), np.random.default_rng(seed))


def test_points_lie_on_the_walls_in_rings(caster: RayCaster) -> None:
    scan = lidar(caster, noise_m=0.0, azimuth_step_deg=1.0).scan(POSE, 2.0)
    assert scan.points_m.shape == (16 * 360, 3)
    assert (scan.timestamp_s, scan.sequence) == (2.0, 0)
    points = POSE.apply(scan.points_m.astype(float))
    assert caster.distance_to_surface(points).max() < 1e-4
    level = np.linalg.norm(scan.points_m[:, :2], axis=1)
    elevation = np.degrees(np.arctan2(scan.points_m[:, 2], level)).reshape(360, 16)
    np.testing.assert_allclose(elevation, np.tile(np.arange(-15, 16, 2), (360, 1)), atol=1e-3)
    # Straight ahead (along the heading) is +x.
    azimuth = np.degrees(np.arctan2(scan.points_m[:16, 1], scan.points_m[:16, 0]))
    np.testing.assert_allclose(azimuth, 0.0, atol=1e-3)


def test_ranges_have_normal_noise_along_their_rays(caster: RayCaster) -> None:
    clean = lidar(caster, noise_m=0.0).scan(POSE, 0.0).points_m
    scan = lidar(caster, noise_m=0.03)
    noisy, again = scan.scan(POSE, 0.0).points_m, scan.scan(POSE, 0.1).points_m
    error = np.linalg.norm(noisy, axis=1) - np.linalg.norm(clean, axis=1)
    assert np.std(error) == pytest.approx(0.03, rel=0.05)
    assert abs(np.mean(error)) < 0.001
    np.testing.assert_allclose(np.cross(noisy, clean), 0.0, atol=1e-4)
    assert not np.array_equal(noisy, again)
    np.testing.assert_array_equal(lidar(caster).scan(POSE, 0.0).points_m, noisy)


def test_what_is_too_far_or_too_near_gives_no_point(caster: RayCaster) -> None:
    points = lidar(caster, range_m=2.0, nearest_m=1.5, noise_m=0.0).scan(POSE, 0.0).points_m
    distance = np.linalg.norm(points, axis=1)
    assert distance.min() >= 1.5
    assert distance.max() <= 2.0 + 1e-6
    assert 0 < len(points) < 16 * 1800


def test_state_brings_back_the_noise(caster: RayCaster) -> None:
    one, other = lidar(caster), lidar(caster, seed=5)
    one.scan(POSE, 0.0)
    other.restore(one.state())
    first, second = one.scan(POSE, 0.1), other.scan(POSE, 0.1)
    np.testing.assert_array_equal(first.points_m, second.points_m)
    assert first.sequence == second.sequence == 1


def test_points_that_are_not_finite_are_refused() -> None:
    with pytest.raises(SensorError, match="scan 0: points must be finite"):
        PointScan(
            points_m=np.array([[np.nan, 0, 0]], np.float32),
            T_world_lidar=SE3.identity(),
            timestamp_s=0.0,
            sequence=0,
        )
