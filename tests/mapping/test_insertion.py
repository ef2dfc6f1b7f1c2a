"""New Gaussians: where, how far apart, how large."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.gaussians.gaussian_map import CENTRE, LOG_RADIUS
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import InsertionConfig
from hgs_core.mapping.insertion import new_gaussians
from hgs_core.mapping.keyframes import TrainingImage

CAMERA = CameraIntrinsics.centred(600, 340, 300.0)


def wall_at(z_m: float) -> TrainingImage:
    return TrainingImage(
        rgb=np.full((340, 600, 3), 128, np.uint8),
        depth_m=np.full((340, 600), z_m, np.float32),
        intrinsics=CAMERA,
        T_world_camera=level_camera_pose(1.0, 2.0, 1.0, 0.7),
    )


@pytest.mark.parametrize(("z_m", "stride_px"), [(4.0, 2), (1.5, 4), (0.8, 8)])
def test_spacing_follows_distance(z_m: float, stride_px: int) -> None:
    config = InsertionConfig()
    image = wall_at(z_m)
    wanted = np.ones((340, 600), bool)
    parameters = new_gaussians(image, wanted, config, coarsening=1)
    assert len(parameters) == pytest.approx(340 * 600 / stride_px**2, rel=0.05)
    spacing = stride_px * z_m / CAMERA.fx
    np.testing.assert_allclose(np.exp(parameters[:, LOG_RADIUS]), 0.6 * spacing, rtol=1e-5)
    points = image.T_world_camera.inverse().apply(parameters[:, CENTRE].astype(float))
    np.testing.assert_allclose(points[:, 2], z_m, rtol=1e-5)
    pixels, inside = CAMERA.project(points)
    assert inside.all()
    np.testing.assert_allclose(pixels % 1.0, 0.5, atol=1e-2)  # pixel centres


def test_only_wanted_pixels(tmp_path: Path) -> None:
    wanted = np.zeros((340, 600), bool)
    assert len(new_gaussians(wall_at(3.0), wanted, InsertionConfig(), coarsening=1)) == 0
    wanted[:, :300] = True
    points = new_gaussians(wall_at(3.0), wanted, InsertionConfig(), coarsening=2)
    local = wall_at(3.0).T_world_camera.inverse().apply(points[:, CENTRE].astype(float))
    assert (local[:, 0] < 0.02).all()
    assert len(points) == pytest.approx(340 * 300 / 16, rel=0.05)
