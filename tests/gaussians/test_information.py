"""Fisher information against the Jacobian that autograd finds, pixel by pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from jaxtyping import Float64
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap, Primitive
from hgs_core.gaussians.information import (
    accumulate_information,
    parameter_priors,
    quality_image,
    view_information,
)
from hgs_core.gaussians.torch_backend import splat
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from tests.gaussians.maps import PRIMITIVES, gaussian_map

CAMERA = CameraIntrinsics(width=19, height=18, fx=15.0, fy=17.0, cx=9.0, cy=8.0)
POSE = level_camera_pose(0.0, 0.2, 1.0, -0.6) @ SE3.exp(np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.1]))


def scene(n: int = 14, seed: int = 2, primitive: Primitive = "isotropic") -> GaussianMap:
    rng = np.random.default_rng(seed)
    depth = np.linspace(1.0, 3.0, n) + rng.uniform(0.1, 0.4, n) * 2.0 / n
    centres = POSE.apply(np.column_stack([rng.uniform(-0.5, 0.5, (n, 2)) * depth[:, None], depth]))
    other = [rng.uniform(0.0, 1.0, (n, 3)), rng.normal(-2.0, 0.5, n), rng.normal(0.0, 1.5, n)]
    return gaussian_map(primitive, np.column_stack([centres, *other]), rng)


def squared_jacobian(gaussians: GaussianMap) -> Float64[ndarray, "height width 3 size 8"]:
    parameters = torch.from_numpy(gaussians.parameters[: gaussians.size]).double()
    normals = torch.from_numpy(gaussians.normals[: gaussians.size]).double()

    def colour(p: torch.Tensor) -> torch.Tensor:
        return splat(p, normals, CAMERA, POSE)[0]

    return torch.autograd.functional.jacobian(colour, parameters).numpy() ** 2


@PRIMITIVES
def test_view_information_is_the_squared_jacobian_summed(primitive: Primitive) -> None:
    gaussians = scene(primitive=primitive)
    expected = squared_jacobian(gaussians).sum(axis=(0, 1, 2))
    information = view_information(gaussians, CAMERA, POSE)
    np.testing.assert_allclose(information, expected, rtol=2e-3, atol=1e-5 * expected.max(axis=0).min())
    assert np.all(information[:, 3] == information[:, 5])
    assert not gaussians.information.any()


def test_what_lies_beyond_the_far_limit_gains_nothing() -> None:
    gaussians = scene()
    depths = POSE.inverse().apply(gaussians.centres_m.astype(np.float64))[:, 2]
    accumulate_information(gaussians, CAMERA, POSE, far_m=2.0)
    assert (gaussians.information[: gaussians.size][depths > 2.0] == 0).all()
    near = GaussianMap()
    near.append(gaussians.parameters[: gaussians.size][depths < 2.0], anchor_keyframe=0)
    expected = view_information(near, CAMERA, POSE)
    np.testing.assert_allclose(gaussians.information[: gaussians.size][depths < 2.0], expected, rtol=1e-5)


@PRIMITIVES
def test_quality_image_is_the_pixelwise_gain(primitive: Primitive) -> None:
    gaussians = scene(primitive=primitive)
    rng = np.random.default_rng(0)
    gaussians.information[: gaussians.size] = rng.uniform(0.0, 5.0, (gaussians.size, 8))
    denominator = gaussians.information[: gaussians.size].astype(float) + parameter_priors(0.1)
    expected = (squared_jacobian(gaussians) / denominator).sum(axis=(2, 3, 4))
    image = quality_image(gaussians, CAMERA, POSE, 0.1)
    np.testing.assert_allclose(image, expected, rtol=2e-3, atol=1e-4 * expected.max())


@PRIMITIVES
def test_quality_image_adds_up_to_the_gain_of_the_view(primitive: Primitive) -> None:
    gaussians = scene(200, seed=7, primitive=primitive)
    accumulate_information(gaussians, CAMERA, POSE)
    gain = (
        view_information(gaussians, CAMERA, POSE) / (gaussians.information[:200] + parameter_priors(0.1))
    ).sum(dtype=float)
    assert quality_image(gaussians, CAMERA, POSE, 0.1).sum(dtype=float) == pytest.approx(gain, rel=1e-4)


def test_accumulating_adds_views() -> None:
    gaussians = scene()
    once = view_information(gaussians, CAMERA, POSE)
    version = gaussians.version
    accumulate_information(gaussians, CAMERA, POSE)
    accumulate_information(gaussians, CAMERA, POSE)
    size = gaussians.size
    np.testing.assert_allclose(gaussians.information[:size], 2.0 * once, rtol=1e-6)
    assert gaussians.version > version


def test_what_lies_beyond_the_range_gains_nothing() -> None:
    gaussians = scene()
    depths = POSE.inverse().apply(gaussians.centres_m.astype(float))[:, 2]
    middle_m = float(np.median(depths))
    near = gaussians.parameters[: gaussians.size][depths < middle_m]
    only_near = GaussianMap()
    only_near.append(near.copy(), anchor_keyframe=0)
    np.testing.assert_array_equal(
        quality_image(gaussians, CAMERA, POSE, 0.1, far_m=middle_m),
        quality_image(only_near, CAMERA, POSE, 0.1),
    )


def test_a_prior_must_be_positive() -> None:
    with pytest.raises(MapError, match="prior_information"):
        quality_image(scene(), CAMERA, POSE, 0.0)


@PRIMITIVES
def test_half_the_pixels_with_four_times_the_weight_tell_as_much(primitive: Primitive) -> None:
    """Of a wall whose Gaussians are as fine as the mapper makes them: two pixels of the whole image apart."""
    whole = CameraIntrinsics.centred(120, 80, 90.0)
    half = replace(whole.scaled(0.5), low_pass_px2=whole.low_pass_px2 / 4)
    apart_m = 2.0 * 2.0 / 80.0
    across, down = np.meshgrid(np.arange(-1.2, 1.2, apart_m), np.arange(-0.8, 0.8, apart_m))
    in_camera = np.column_stack([across.ravel(), down.ravel(), np.full(across.size, 2.0)])
    rng = np.random.default_rng(0)
    in_camera += rng.normal(0.0, 0.2 * apart_m, in_camera.shape) * (1.0, 1.0, 0.1)
    n = len(in_camera)
    columns = [
        POSE.apply(in_camera),
        rng.uniform(0.0, 1.0, (n, 3)),
        np.full(n, np.log(0.5 * apart_m)),
        np.full(n, 0.8),
    ]
    gaussians = gaussian_map(primitive, np.column_stack(columns), rng)
    wanted = np.zeros((n, 8))
    for shift in rng.uniform(-0.1, 0.1, (12, 3)):
        pose = POSE @ SE3.exp(np.array([*shift, 0.0, 0.0, 0.0]))
        wanted += view_information(gaussians, whole, pose)
        accumulate_information(gaussians, half, pose, pixel_weight=4.0)
    found = gaussians.information[:n]
    np.testing.assert_allclose(found.sum(axis=0), wanted.sum(axis=0), rtol=0.1)
    for column in range(8):
        assert np.corrcoef(found[:, column], wanted[:, column])[0, 1] > 0.9
