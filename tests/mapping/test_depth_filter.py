"""Halving and smoothing of depth: exact on planes, blind to nothing, edges kept."""

import numpy as np
import pytest

from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import DepthFusionConfig
from hgs_core.mapping.depth_filter import training_image
from hgs_core.sensing.frame import Frame

CAMERA = CameraIntrinsics.centred(120, 80, 60.0)


def frame_of(depth: np.ndarray, rgb: np.ndarray | None = None) -> Frame:
    return Frame(
        rgb=np.zeros((80, 120, 3), np.uint8) if rgb is None else rgb,
        depth_m=depth.astype(np.float32),
        intrinsics=CAMERA,
        T_world_camera=level_camera_pose(0, 0, 1, 0),
        timestamp_s=0.0,
        sequence=0,
    )


def slanted_plane(camera: CameraIntrinsics) -> np.ndarray:
    """Depth of the plane n.p = 1 with n = (0.1, 0.25, 0.2): inverse depth is linear in the pixel."""
    return 1.0 / (camera.rays() @ np.array([0.1, 0.25, 0.2]))


def test_smoothing_keeps_a_slanted_plane() -> None:
    depth = slanted_plane(CAMERA)
    depth = np.where((depth > 0) & (depth < 8), depth, np.inf)
    image = training_image(frame_of(depth), DepthFusionConfig())
    truth = slanted_plane(image.intrinsics)
    inner = np.isfinite(image.depth_m) & (truth > 0) & (truth < 4)
    inner[:, :3] = inner[:, -3:] = False
    assert inner.sum() > 500
    # The 2 x 2 mean is one of depth, not of inverse depth: curvature within a pixel remains.
    np.testing.assert_allclose(image.depth_m[inner], truth[inner], rtol=2e-3)


def test_smoothing_divides_the_noise() -> None:
    rng = np.random.default_rng(0)
    noisy = 2.0 + rng.uniform(-0.02, 0.02, (80, 120))
    image = training_image(frame_of(noisy), DepthFusionConfig())
    error = image.depth_m[3:-3, 3:-3] - 2.0
    raw = 0.02 / np.sqrt(3)
    assert np.std(error) < raw / 6  # 100 pixels average into one: at best raw / 10
    assert abs(error.mean()) < raw / 50


def test_an_edge_stays_an_edge() -> None:
    depth = np.full((80, 120), 3.0)
    depth[:, 60:] = 1.5
    image = training_image(frame_of(depth), DepthFusionConfig())
    np.testing.assert_allclose(image.depth_m[:, :30], 3.0, rtol=1e-5)
    np.testing.assert_allclose(image.depth_m[:, 30:], 1.5, rtol=1e-5)


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ([[0, 0], [0, 0]], 0.0),
        ([[np.inf, np.inf], [np.inf, 0]], np.inf),
        ([[2.0, np.inf], [0, 0]], 2.0),
        ([[2.0, 2.02], [3.0, 3.0]], 2.01),
    ],
)
def test_halving_rules(block: list[list[float]], expected: float) -> None:
    depth = np.zeros((80, 120))
    depth[:2, :2] = block
    image = training_image(frame_of(depth), DepthFusionConfig(smoothing_radius_px=0))
    assert image.depth_m[0, 0] == pytest.approx(expected)


def test_colours_are_averaged_and_rounded() -> None:
    rgb = np.zeros((80, 120, 3), np.uint8)
    rgb[:2, :2, 0] = [[10, 11], [12, 13]]
    image = training_image(frame_of(np.ones((80, 120)), rgb), DepthFusionConfig())
    assert image.rgb[0, 0].tolist() == [12, 0, 0]


def test_splats_are_as_wide_in_the_halved_image_as_in_the_full_one() -> None:
    """The low pass covers the same piece of surface in both, so training on one does not shrink the other."""
    halved = training_image(frame_of(np.full((80, 120), 2.0)), DepthFusionConfig()).intrinsics
    assert halved.low_pass_px2 / halved.fx**2 == pytest.approx(CAMERA.low_pass_px2 / CAMERA.fx**2)
