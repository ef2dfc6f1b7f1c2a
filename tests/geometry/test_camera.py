"""The pinhole camera and the robot's level camera pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.errors import ConfigError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose

cameras = st.builds(
    CameraIntrinsics,
    width=st.integers(1, 40),
    height=st.integers(1, 40),
    fx=st.floats(1, 1000),
    fy=st.floats(1, 1000),
    cx=st.floats(-5, 45),
    cy=st.floats(-5, 45),
)


@given(cameras, st.floats(0.01, 100))
def test_projecting_a_pixels_ray_gives_its_centre(camera: CameraIntrinsics, depth_m: float) -> None:
    points = (camera.rays() * depth_m).reshape(-1, 3)
    pixels, inside = camera.project(points)
    rows, columns = np.mgrid[: camera.height, : camera.width]
    centres = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1)
    np.testing.assert_allclose(pixels, centres, atol=1e-6)
    assert inside.all()


@given(cameras)
def test_rays_have_unit_depth(camera: CameraIntrinsics) -> None:
    rays = camera.rays()
    assert rays.shape == (camera.height, camera.width, 3)
    assert (rays[..., 2] == 1).all()


def test_the_image_is_half_open_and_what_is_behind_is_outside() -> None:
    camera = CameraIntrinsics(width=4, height=2, fx=2.0, fy=2.0, cx=2.0, cy=1.0)
    points = np.array(
        [[-1.0, -0.5, 1.0], [1.0, 0.0, 1.0], [0.0, 0.5, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]
    )
    pixels, inside = camera.project(points)
    assert inside.tolist() == [True, False, False, False, False]
    np.testing.assert_allclose(pixels[:3], [[0, 0], [4, 1], [2, 2]])


def test_field_of_view_of_a_right_angle() -> None:
    camera = CameraIntrinsics.centred(200, 100, 100.0)
    assert camera.horizontal_fov_rad == pytest.approx(np.pi / 2)
    assert camera.vertical_fov_rad == pytest.approx(2 * np.arctan(0.5))


@given(st.integers(1, 5))
def test_scaling_keeps_the_field_of_view(factor: int) -> None:
    camera = CameraIntrinsics.centred(120, 80, 60.0)
    scaled = camera.scaled(factor)
    assert (scaled.width, scaled.height) == (120 * factor, 80 * factor)
    assert scaled.horizontal_fov_rad == pytest.approx(camera.horizontal_fov_rad)
    assert scaled.vertical_fov_rad == pytest.approx(camera.vertical_fov_rad)


@pytest.mark.parametrize(
    ("field", "value"), [("width", 0), ("height", 0), ("fx", 0.0), ("fy", -1.0), ("low_pass_px2", 0.0)]
)
def test_an_impossible_camera_is_refused(field: str, value: float) -> None:
    allowed = {"width": 4, "height": 2, "fx": 2.0, "fy": 2.0, "cx": 2.0, "cy": 1.0, "low_pass_px2": 0.3}
    with pytest.raises(ConfigError, match="positive"):
        CameraIntrinsics(**{**allowed, field: value})


@given(st.floats(-10, 10), st.floats(-5, 5), st.floats(-5, 5), st.floats(0, 2))
def test_a_level_camera_looks_along_its_yaw_with_the_world_upright(
    yaw_rad: float, x_m: float, y_m: float, z_m: float
) -> None:
    pose = level_camera_pose(x_m, y_m, z_m, yaw_rad)
    np.testing.assert_allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1)
    forward, down = pose.rotation[:, 2], pose.rotation[:, 1]
    np.testing.assert_allclose(forward, [np.cos(yaw_rad), np.sin(yaw_rad), 0], atol=1e-12)
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(pose.apply(np.zeros(3)), [x_m, y_m, z_m])


def test_what_is_to_the_left_in_the_world_is_left_in_the_image() -> None:
    camera = CameraIntrinsics.centred(100, 80, 50.0)
    pose = level_camera_pose(0.0, 0.0, 1.0, 0.0)  # looks along +x, so +y is to its left
    ahead_left_and_high = np.array([[2.0, 0.5, 1.5]])
    pixels, inside = camera.project(pose.inverse().apply(ahead_left_and_high))
    # x_camera = -y = -0.5, y_camera = -(z - 1) = -0.5, depth 2: u = 50 - 12.5, v = 40 - 12.5
    np.testing.assert_allclose(pixels, [[37.5, 27.5]])
    assert inside.all()
