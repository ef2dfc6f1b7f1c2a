"""Steps on the surface from pixel to pixel, against planes."""

import numpy as np
import pytest

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.surface import surface_borders, surface_steps

CAMERA = CameraIntrinsics.centred(60, 40, 30.0)


def plane_depth(normal: tuple[float, float, float], offset_m: float) -> np.ndarray:
    return (offset_m / (CAMERA.rays() @ np.array(normal))).astype(np.float32)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.5, 0.1, 1.0), (-0.2, 0.6, 1.0)])
def test_steps_on_a_plane_are_the_distances_of_its_points(normal: tuple[float, float, float]) -> None:
    depth = plane_depth(normal, 2.0)
    points = CAMERA.rays() * depth[..., None]
    rows, columns = (a.ravel() for a in np.mgrid[5:35, 5:55])
    across, down = surface_steps(depth, CAMERA, rows, columns)
    wide = np.linalg.norm(points[rows, columns + 1] - points[rows, columns - 1], axis=1) / 2
    high = np.linalg.norm(points[rows + 1, columns] - points[rows - 1, columns], axis=1) / 2
    np.testing.assert_allclose(across, wide, rtol=0.05)
    np.testing.assert_allclose(down, high, rtol=0.05)


def test_steps_at_a_border_follow_the_surface_and_not_the_jump() -> None:
    depth = np.where(np.arange(60) < 30, 1.0, 3.0)[None, :].repeat(40, axis=0).astype(np.float32)
    depth[:, 45] = 0.0
    depth[:, 50] = np.inf
    rows, columns = np.full(6, 20), np.array([29, 30, 44, 46, 49, 59])
    across, down = surface_steps(depth, CAMERA, rows, columns)
    facing = depth[rows, columns] / CAMERA.fx
    np.testing.assert_allclose(across, facing, rtol=1e-5)
    np.testing.assert_allclose(down, facing, rtol=1e-5)


def test_steps_have_an_end() -> None:
    depth = plane_depth((1.0, 0.0, 0.02), 1.0)
    rows, columns = np.array([20]), np.array([31])
    across, _ = surface_steps(depth, CAMERA, rows, columns)
    np.testing.assert_allclose(across, 8.0 * depth[20, 31] / CAMERA.fx, rtol=1e-5)


def test_borders_are_where_surfaces_end_and_nowhere_on_a_plane() -> None:
    assert not surface_borders(plane_depth((0.5, 0.3, 1.0), 2.0)).any()
    depth = plane_depth((0.1, 0.0, 1.0), 2.0)
    depth[:, 30:33] = 1.5  # a leg before a wall
    depth[10, 50] = 0.0
    borders = surface_borders(depth)
    assert borders[:, 28:35].all()
    assert not borders[:, :26].any()
    assert not borders[20:, 37:].any()
    assert borders[9, 50]
    assert borders[10, 49]
    assert not borders[10, 50]


def test_what_noise_is_left_makes_no_borders() -> None:
    rng = np.random.default_rng(3)
    depth = plane_depth((0.3, 0.2, 1.0), 3.0)
    noisy = depth + rng.normal(0.0, 0.005, depth.shape).astype(np.float32)
    assert surface_borders(noisy).mean() < 0.02
