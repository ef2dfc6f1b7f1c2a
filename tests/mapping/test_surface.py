"""Steps on the surface from pixel to pixel, against planes."""

import numpy as np
import pytest

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.surface import surface_borders, surface_normals, surface_slopes, surface_steps
from tests.mapping.surface_oracle import plain_normals

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
    depth = plane_depth((1.0, 0.0, 0.0), 1.0)
    rows, columns = np.array([20]), np.array([30])
    across, _ = surface_steps(depth, CAMERA, rows, columns)
    np.testing.assert_allclose(across, 32.0 * depth[20, 30] / CAMERA.fx, rtol=1e-5)


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


def test_a_surface_goes_on_up_to_its_border_and_nowhere_on_a_leg_of_one_pixel() -> None:
    depth = plane_depth((0.5, 0.2, 1.0), 2.0)
    depth[:, 30:] += np.float32(0.7)
    depth[:, 50] = 0.5
    depth[:, 5] = 0.0
    columns = np.arange(60)
    rows = np.full(60, 20)
    measured = columns != 5
    by_column, along = surface_slopes(depth, rows[measured], columns[measured], 0)
    assert set(columns[measured][~along].tolist()) == {50}
    before, last = 1.0 / depth[20, 28:30].astype(np.float64)
    assert by_column[28] == pytest.approx(last - before, abs=1e-5)  # of column 29: column 5 is left out
    assert surface_slopes(depth, rows[measured], columns[measured], 1)[1].all()
    every_other = np.where(np.arange(40)[:, None] % 2, depth, 0.0).astype(np.float32)
    slopes, goes_on = surface_slopes(every_other, rows[measured] + 1, columns[measured], 1)
    assert not goes_on.any()
    assert not slopes.any()


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.5, 0.1, 1.0), (-0.2, 0.6, 1.0), (0.9, 0.0, 0.25)])
def test_normals_on_a_plane_are_its_own(normal: tuple[float, float, float]) -> None:
    depth = plane_depth(normal, 1.0)
    depth[(depth < 0) | (depth > 8.0)] = 0.0
    rows, columns = np.nonzero(depth)
    inner = (rows > 4) & (rows < 35) & (columns > 4) & (columns < 55)
    found = surface_normals(depth, CAMERA, rows[inner], columns[inner])
    unit = -np.array(normal) / np.linalg.norm(normal)
    cosines = found @ unit
    assert np.median(cosines) > 1.0 - 1e-6
    assert np.mean(cosines > 0.999) > 0.95


def test_normals_under_noise_are_off_by_degrees() -> None:
    depth = plane_depth((0.5, 0.1, 1.0), 2.0)
    depth += np.random.default_rng(0).normal(0.0, 0.0025, depth.shape).astype(np.float32)
    rows, columns = (a.ravel() for a in np.mgrid[5:35, 5:55])
    cosines = surface_normals(depth, CAMERA, rows, columns) @ (-np.array([0.5, 0.1, 1.0]) / np.sqrt(1.26))
    assert np.degrees(np.arccos(np.quantile(cosines, 0.1))) < 4.0


def test_normals_at_an_edge_are_those_of_either_side() -> None:
    """Two walls that meet at a right angle, seen from within: no pixel takes a normal between."""
    rays = CAMERA.rays()
    sides = [np.array([0.7, 0.0, 0.7]), np.array([-0.7, 0.0, 0.7])]
    depth = np.min([1.4 / np.maximum(rays @ side, 1e-3) for side in sides], axis=0).astype(np.float32)
    rows, columns = (a.ravel() for a in np.mgrid[5:35, 5:55])
    found = surface_normals(depth, CAMERA, rows, columns)
    nearest = np.max([-(found @ side) for side in sides], axis=0) / np.linalg.norm(sides[0])
    assert np.mean(nearest > np.cos(np.radians(10.0))) > 0.9


def test_without_a_surface_around_a_normal_looks_at_the_camera() -> None:
    depth = np.zeros((40, 60), np.float32)
    depth[20, 30] = 2.0
    found = surface_normals(depth, CAMERA, np.array([20]), np.array([30]))
    ray = CAMERA.rays()[20, 30]
    np.testing.assert_allclose(found[0], -ray / np.linalg.norm(ray), atol=1e-12)


def test_normals_are_those_of_plain_arithmetic_in_a_room_with_holes_and_steps() -> None:
    rng = np.random.default_rng(5)
    walls = [plane_depth(normal, 2.0) for normal in ((0.1, 0.3, 1.0), (0.62, -0.2, 0.7), (-0.7, 0.1, 0.83))]
    depth = np.min([np.where(wall > 0, wall, 9.0) for wall in walls], axis=0).astype(np.float32)
    depth[12:20, 20:24] -= np.float32(0.6)
    depth += rng.normal(0.0, 0.004, depth.shape).astype(np.float32)
    depth[rng.random(depth.shape) < np.linspace(0.0, 0.9, 40)[:, None]] = 0.0
    depth[:6, 40:] = np.inf
    rows, columns = np.nonzero((depth > 0) & np.isfinite(depth))
    wanted, n_on_plane = plain_normals(depth, CAMERA, rows, columns)
    assert 0.02 < np.mean(n_on_plane < 12) < 0.98
    np.testing.assert_allclose(surface_normals(depth, CAMERA, rows, columns), wanted, atol=1e-6)
