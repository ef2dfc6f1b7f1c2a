"""Lens models against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.errors import ConfigError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import Distortion, LensCamera

CAMERA = CameraIntrinsics(width=64, height=48, fx=50.0, fy=52.0, cx=33.0, cy=23.0)
PINCUSHION = Distortion(model="plumb_bob", coefficients=(0.2, 0.0, 0.0, 0.0))
BARREL = Distortion(model="plumb_bob", coefficients=(-0.1, 0.01, 1e-3, -2e-3, 0.0))
RATIONAL = Distortion(model="rational_polynomial", coefficients=(0.3, 0.1, 1e-3, 2e-3, 0.05, 0.2, 0.1, 0.02))
FISHEYE = Distortion(model="equidistant", coefficients=(0.0, 0.0, 0.0, 0.0))


def test_a_radial_term_moves_points_along_their_radius_by_its_formula():
    x, y = 0.3, -0.4  # r = 0.5
    np.testing.assert_allclose(
        Distortion(model="plumb_bob", coefficients=(0.2, 0.4, 0.0, 0.0, 0.8)).distort(np.array([x, y])),
        np.array([x, y]) * (1 + 0.2 * 0.25 + 0.4 * 0.25**2 + 0.8 * 0.25**3),
    )


def test_tangential_terms_are_those_of_opencv():
    """x + 2 p1 x y + p2 (r^2 + 2 x^2), y + p1 (r^2 + 2 y^2) + 2 p2 x y at (1, 2), r^2 = 5."""
    moved = Distortion(model="plumb_bob", coefficients=(0.0, 0.0, 0.01, 0.001)).distort(np.array([1.0, 2.0]))
    np.testing.assert_allclose(moved, [1.0 + 0.04 + 0.007, 2.0 + 0.13 + 0.004])


def test_a_rational_model_without_denominator_is_the_polynomial_one():
    xy = np.random.default_rng(0).uniform(-0.7, 0.7, (20, 2))
    plain = Distortion(model="plumb_bob", coefficients=(0.2, -0.1, 1e-3, 2e-3, 0.03))
    rational = Distortion(model="rational_polynomial", coefficients=(0.2, -0.1, 1e-3, 2e-3, 0.03, 0, 0, 0))
    np.testing.assert_allclose(rational.distort(xy), plain.distort(xy))
    same = Distortion(model="rational_polynomial", coefficients=(0.2, -0.1, 0, 0, 0.03, 0.2, -0.1, 0.03))
    np.testing.assert_allclose(same.distort(xy), xy)  # numerator = denominator


@given(angle=st.floats(0.0, 1.4), direction=st.floats(-np.pi, np.pi))
def test_a_plain_fisheye_shows_angles_as_radii(angle: float, direction: float):
    unit = np.array([np.cos(direction), np.sin(direction)])
    np.testing.assert_allclose(FISHEYE.distort(np.tan(angle) * unit), angle * unit, atol=1e-9)


def test_no_lens_moves_nothing():
    xy = np.random.default_rng(0).uniform(-1, 1, (5, 2))
    for none in (Distortion(), Distortion(model="plumb_bob", coefficients=(0.0,) * 5)):
        assert none.is_none
        np.testing.assert_array_equal(none.distort(xy), xy)
    assert LensCamera(intrinsics=CAMERA).undistorted() == CAMERA
    assert not FISHEYE.is_none


@pytest.mark.parametrize("distortion", [PINCUSHION, BARREL, RATIONAL, FISHEYE], ids=lambda d: d.model)
def test_every_pixel_of_the_undistorted_camera_was_seen(distortion: Distortion):
    camera = LensCamera(intrinsics=CAMERA, distortion=distortion)
    pinhole = camera.undistorted()
    assert (pinhole.width, pinhole.height, pinhole.cx, pinhole.cy) == (64, 48, 33.0, 23.0)
    uv = camera.project(pinhole.rays()[..., :2])
    assert uv.min() >= 0.0
    assert (uv <= [64, 48]).all()


def test_focal_lengths_grow_only_as_far_as_they_must():
    assert LensCamera(intrinsics=CAMERA, distortion=BARREL).undistorted() == CAMERA
    camera = LensCamera(intrinsics=CAMERA, distortion=PINCUSHION)
    zoom = camera.undistorted().fx / CAMERA.fx
    assert 1.0 < zoom < 1.3
    assert camera.undistorted().fy / CAMERA.fy == pytest.approx(zoom)


@pytest.mark.parametrize(
    ("model", "coefficients", "message"),
    [
        ("fisheye62", (), "no distortion model 'fisheye62'"),
        ("plumb_bob", (0.1,), "takes 4 or 5 coefficients, got 1"),
        ("equidistant", (0.0, 0.0, 0.0, float("nan")), "must be finite"),
    ],
)
def test_wrong_coefficients_are_refused(model, coefficients, message):
    with pytest.raises(ConfigError, match=message):
        Distortion.named(model, coefficients)


def test_a_lens_that_folds_the_image_is_refused():
    """r (1 - 2 r^2) turns back at r = 0.41; the corners lie at 0.79."""
    folding = Distortion(model="plumb_bob", coefficients=(-2.0, 0.0, 0.0, 0.0))
    with pytest.raises(ConfigError, match="shows some rays twice"):
        LensCamera(intrinsics=CAMERA, distortion=folding).undistorted()
