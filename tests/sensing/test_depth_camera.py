import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hgs_core.config.presets import load_preset
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.sensing.depth_camera import DepthCameraConfig, with_uniform_noise
from hgs_core.sensing.scanner import ScannerConfig


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.5))
def test_noise_stays_in_its_bounds_and_never_makes_depth_negative(seed, half_width):
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.001, 6.0, (20, 30)).astype(np.float32)
    depth[0], depth[1] = 0.0, np.inf
    noisy = with_uniform_noise(depth, half_width, rng)
    assert noisy.dtype == np.float32
    assert (noisy[0] == 0).all()
    assert np.isinf(noisy[1]).all()
    assert (noisy[2:] > 0).all()
    changed = noisy[2:] > 0.0011
    assert np.abs(noisy[2:] - depth[2:])[changed].max() <= half_width + 1e-5


def test_draws_do_not_depend_on_what_is_seen():
    first, second = np.random.default_rng(3), np.random.default_rng(3)
    with_uniform_noise(np.full((4, 5), np.inf, dtype=np.float32), 0.02, first)
    with_uniform_noise(np.ones((4, 5), dtype=np.float32), 0.02, second)
    assert first.random() == second.random()


def test_the_preset_is_the_papers_camera():
    preset = load_preset("sensor", "rgbd_5m")
    assert DepthCameraConfig(**preset["camera"]) == DepthCameraConfig()
    assert ScannerConfig(**preset["scanner"]) == ScannerConfig()
    intrinsics = DepthCameraConfig().intrinsics()
    assert (intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.cx) == (1200, 680, 600.0, 600.0)
    assert np.degrees(intrinsics.horizontal_fov_rad) == pytest.approx(90.0)


def test_the_robot_preset_is_the_default_robot():
    assert DifferentialConfig(**load_preset("robot", "wheeled")) == DifferentialConfig()


@pytest.mark.parametrize("field", ["range_m", "focal_px", "frame_interval_s", "mount_height_m"])
def test_impossible_cameras_are_refused(field):
    with pytest.raises(ValidationError, match=field):
        DepthCameraConfig(**{field: 0.0})
