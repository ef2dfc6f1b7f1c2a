"""The native rasteriser against the written-down model, and laws that both must keep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st

import hgs_core.native.kernels as kernels
from hgs_core.errors import ConfigError
from hgs_core.gaussians.gaussian_map import BLOCK, GaussianMap, Primitive
from hgs_core.gaussians.native_backend import NativeBackend
from hgs_core.gaussians.render import render
from hgs_core.gaussians.torch_backend import TorchBackend, splat
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from tests.gaussians.maps import PRIMITIVES, gaussian_map

CAMERA = CameraIntrinsics(width=53, height=37, fx=40.0, fy=44.0, cx=25.0, cy=19.5)  # no multiple of a tile
POSE = level_camera_pose(0.3, -0.2, 1.0, 0.7) @ SE3.exp(np.array([0.0, 0.0, 0.0, 0.1, -0.05, 0.2]))


def scene(n: int, seed: int, *, radius_m: float = 0.1, primitive: Primitive = "isotropic") -> GaussianMap:
    """Random Gaussians in front of, beside and behind `POSE`; no two depths nearly equal."""
    rng = np.random.default_rng(seed)
    depth = np.linspace(-0.5, 5.0, n) + rng.uniform(0.1, 0.4, n) * 5.5 / n
    spread = rng.uniform(-1.2, 1.2, (n, 2)) * np.abs(depth)[:, None]
    centres = POSE.apply(np.column_stack([spread, depth]))
    order = rng.permutation(n)
    parameters = np.column_stack(
        [
            centres,
            rng.uniform(0.0, 1.0, (n, 3)),
            np.log(radius_m) + rng.normal(0.0, 0.6, n),
            rng.normal(0.5, 2.5, n),
        ]
    )
    return gaussian_map(primitive, parameters[order], rng)


def one(x: float, y: float, z: float, *, radius_m: float, logit: float) -> GaussianMap:
    gaussians = GaussianMap()
    row = np.array([[x, y, z, 0.8, 0.4, 0.2, np.log(radius_m), logit]], np.float32)
    gaussians.append(row, anchor_keyframe=0)
    return gaussians


@pytest.mark.parametrize(
    ("n", "low_pass_px2"), [(1, 0.3), (40, 0.3), (300, 0.3), (700, 0.3), (300, 0.01), (300, 3.0)]
)
@PRIMITIVES
def test_native_draws_what_the_reference_draws(primitive: Primitive, n: int, low_pass_px2: float) -> None:
    gaussians, camera = scene(n, n, primitive=primitive), replace(CAMERA, low_pass_px2=low_pass_px2)
    native, reference = render(gaussians, camera, POSE), render(gaussians, camera, POSE, backend="torch")
    np.testing.assert_allclose(native.colour_sum, reference.colour_sum, atol=2e-5)
    np.testing.assert_allclose(native.depth_sum, reference.depth_sum, atol=1e-4)
    np.testing.assert_allclose(native.silhouette, reference.silhouette, atol=2e-5)
    assert reference.silhouette.max() > 0.1 or n == 1


@pytest.mark.parametrize("backend", ["native", "torch"])
@pytest.mark.parametrize("far_m", [0.0, 1.0, 2.5, 9.0])
def test_a_far_limit_leaves_out_what_is_beyond_it(far_m: float, backend: str) -> None:
    gaussians = scene(700, seed=3)
    depths = POSE.inverse().apply(gaussians.centres_m.astype(np.float64))[:, 2]
    near = GaussianMap()
    near.append(gaussians.parameters[: gaussians.size][depths < far_m], anchor_keyframe=0)
    limited = render(gaussians, CAMERA, POSE, far_m=far_m, backend=backend)
    without = render(near, CAMERA, POSE, backend=backend)
    np.testing.assert_allclose(limited.colour_sum, without.colour_sum, atol=1e-6)
    np.testing.assert_allclose(limited.silhouette, without.silhouette, atol=1e-6)


@pytest.mark.parametrize(("n", "low_pass_px2"), [(40, 0.3), (300, 0.3), (700, 0.3), (300, 0.075)])
@PRIMITIVES
def test_native_gradient_is_autograds(primitive: Primitive, n: int, low_pass_px2: float) -> None:
    gaussians, camera = scene(n, n, primitive=primitive), replace(CAMERA, low_pass_px2=low_pass_px2)
    rng = np.random.default_rng(5)
    shape = (CAMERA.height, CAMERA.width)
    incoming = (
        rng.normal(size=(*shape, 3)).astype(np.float32),
        rng.normal(size=shape).astype(np.float32),
        rng.normal(size=shape).astype(np.float32),
    )
    native = NativeBackend().backward(gaussians, camera, POSE, *incoming)
    reference = TorchBackend().backward(gaussians, camera, POSE, *incoming)
    for mine, truth in (
        (native.parameters, reference.parameters),
        (native.normals, reference.normals),
    ):
        scale = np.abs(truth).max(axis=0)
        # Sums of float32 over a few hundred pixels: discs are off by up to 6.5e-5, `portable`.
        np.testing.assert_allclose(mine / scale, truth / scale, atol=1e-4 if primitive == "disc" else 2e-5)
    assert np.count_nonzero(reference.parameters.any(axis=1)) >= 10


@PRIMITIVES
def test_every_entry_of_the_reference_gradient_is_the_numeric_one(primitive: Primitive) -> None:
    """Central differences in float64; wide Gaussians, so that no pixel is at a limit where alpha is cut."""
    rng = np.random.default_rng(7)
    parameters = scene(4, seed=3).parameters[:4].copy()
    parameters[:, :3] = POSE.apply(rng.uniform([-0.3, -0.2, 1.2], [0.3, 0.2, 2.0], (4, 3)))
    parameters[:, 6:] = np.column_stack([np.full(4, np.log(1.5)), np.linspace(-1.0, 1.0, 4)])
    gaussians = gaussian_map(primitive, parameters, rng)
    if primitive == "disc":
        tilted = rng.uniform([-0.7, -0.7, -1.0], [0.7, 0.7, -0.9], (4, 3))
        tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
        gaussians.normals[:4] = tilted @ POSE.rotation.T
    weights = [torch.from_numpy(rng.normal(size=(CAMERA.height, CAMERA.width))) for _ in range(3)]

    def loss(rows: torch.Tensor, normals: torch.Tensor) -> torch.Tensor:
        colour, depth, silhouette = splat(rows, normals, CAMERA, POSE)
        return sum(
            (
                (w * image).sum()
                for w, image in zip(weights, (colour[..., 1], depth, silhouette), strict=True)
            ),
            torch.zeros(()),
        )

    rows = torch.from_numpy(gaussians.parameters[:4]).double().requires_grad_()
    normals = torch.from_numpy(gaussians.normals[:4]).double().requires_grad_()
    analytic = torch.autograd.grad(loss(rows, normals), (rows, normals), allow_unused=True)
    for which, gradient in enumerate(analytic):
        arguments = (rows.detach(), normals.detach())
        for index in np.ndindex(*arguments[which].shape):
            moved = []
            for step in (1e-6, -1e-6):
                changed = [tensor.clone() for tensor in arguments]
                changed[which][index] += step
                moved.append(float(loss(*changed)))
            numeric = (moved[0] - moved[1]) / 2e-6
            assert float(gradient[index]) == pytest.approx(numeric, rel=1e-4, abs=1e-4)


def test_reference_gradient_is_the_numeric_one() -> None:
    gaussians = scene(12, seed=3)
    shape = (CAMERA.height, CAMERA.width)
    ones = np.ones((*shape, 3), np.float32), np.ones(shape, np.float32), np.ones(shape, np.float32)
    gradient = TorchBackend().backward(gaussians, CAMERA, POSE, *ones).parameters

    def total() -> float:
        view = TorchBackend().forward(gaussians, CAMERA, POSE)
        return float(
            view.colour_sum.sum(dtype=float)
            + view.depth_sum.sum(dtype=float)
            + view.silhouette.sum(dtype=float)
        )

    step = np.float32(1e-3)
    row = int(np.argmax(np.abs(gradient[:, 3])))
    for column in (3, 4, 5):  # the sums are linear in the colours: any step is exact
        before = total()
        gaussians.parameters[row, column] += step
        assert (total() - before) / step == pytest.approx(gradient[row, column], rel=2e-2)


def test_one_gaussian_by_hand() -> None:
    """r = 0.1 m at 2 m and f = 100 px: sigma^2 = 25.3. At the pixel whose centre the Gaussian hits, alpha is
    its opacity 0.5; three pixels to the side it is 0.5 exp(-9 / 50.6)."""
    camera = CameraIntrinsics(width=31, height=31, fx=100.0, fy=100.0, cx=15.5, cy=15.5, low_pass_px2=0.3)
    view = render(one(0.0, 0.0, 2.0, radius_m=0.1, logit=0.0), camera, SE3.identity())
    assert view.silhouette[15, 15] == pytest.approx(0.5, abs=1e-6)
    assert view.silhouette[15, 18] == pytest.approx(0.5 * np.exp(-9.0 / 50.6), abs=1e-6)
    np.testing.assert_allclose(view.colour_sum[15, 15], [0.4, 0.2, 0.1], atol=1e-6)
    np.testing.assert_allclose(view.colour[15, 18], [0.8, 0.4, 0.2], atol=1e-6)
    assert view.depth_sum[15, 15] == pytest.approx(1.0, abs=1e-6)
    assert view.depth_m[15, 15] == pytest.approx(2.0, abs=1e-5)
    assert view.silhouette[0, 0] == 0.0  # 450 px^2 away: 0.5 exp(-8.9) < 1/255
    assert view.depth_m[0, 0] == 0.0
    assert not view.colour[0, 0].any()


def test_a_tilted_disc_by_hand() -> None:
    """r = 0.1 m at 2 m and f = 100 px, turned by 60 degrees about the vertical: 5 px wide up and down, half
    of that across: variances 25.3 and 6.55 px^2. Its plane falls back by 1.732 m a metre, 0.0346 m a pixel;
    as 6.25 of the 6.55 px^2 are its own, the depth d px to the right grows by 6.25 / 6.55 of that."""
    camera = CameraIntrinsics(width=31, height=31, fx=100.0, fy=100.0, cx=15.5, cy=15.5, low_pass_px2=0.3)
    gaussians = GaussianMap(primitive="disc")
    row = np.array([[0.0, 0.0, 2.0, 0.8, 0.4, 0.2, np.log(0.1), 0.0]], np.float32)
    normal = np.array([[np.sin(np.pi / 3), 0.0, -np.cos(np.pi / 3)]], np.float32)
    gaussians.append(row, normal, anchor_keyframe=0)
    view = render(gaussians, camera, SE3.identity())
    assert view.silhouette[15, 15] == pytest.approx(0.5, abs=1e-6)
    assert view.silhouette[18, 15] == pytest.approx(0.5 * np.exp(-9.0 / 50.6), abs=1e-6)
    assert view.silhouette[15, 18] == pytest.approx(0.5 * np.exp(-9.0 / 13.1), abs=1e-6)
    assert view.depth_m[15, 15] == pytest.approx(2.0, abs=1e-5)
    assert view.depth_m[18, 15] == pytest.approx(2.0, abs=1e-5)
    assert view.depth_m[15, 18] == pytest.approx(2.0 + 3 * np.tan(np.pi / 3) / 50.0 * 6.25 / 6.55, abs=1e-5)


def test_a_disc_looks_the_same_from_behind() -> None:
    gaussians, turned = scene(60, 1, primitive="disc"), scene(60, 1, primitive="disc")
    turned.normals *= -1.0
    np.testing.assert_array_equal(
        render(gaussians, CAMERA, POSE).depth_sum, render(turned, CAMERA, POSE).depth_sum
    )


def test_the_nearer_of_two_hides_the_farther_whatever_their_order() -> None:
    camera = CameraIntrinsics(width=9, height=9, fx=50.0, fy=50.0, cx=4.5, cy=4.5)
    near = [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, np.log(0.5), 20.0]
    far = [0.0, 0.0, 2.0, 0.0, 1.0, 0.0, np.log(0.5), 20.0]
    for rows in ([near, far], [far, near]):
        gaussians = GaussianMap()
        gaussians.append(np.array(rows, np.float32), anchor_keyframe=0)
        view = render(gaussians, camera, SE3.identity())
        np.testing.assert_allclose(view.colour_sum[4, 4], [0.99, 0.01 * 0.99, 0.0], atol=1e-6)
        assert view.silhouette[4, 4] == pytest.approx(0.9999, abs=1e-6)


def test_nothing_is_drawn_from_an_empty_map_or_behind_the_near_plane() -> None:
    for gaussians in (
        GaussianMap(),
        one(0.0, 0.0, 0.09, radius_m=0.1, logit=3.0),
        one(0.0, 0.0, -2.0, radius_m=0.1, logit=3.0),
    ):
        view = render(gaussians, CAMERA, SE3.identity())
        assert not view.silhouette.any()
        assert not view.colour_sum.any()
        assert not view.depth_sum.any()


def test_a_splat_next_to_the_camera_covers_the_whole_picture() -> None:
    camera = CameraIntrinsics.centred(200, 120, 100.0)
    view = render(one(0.0, 0.0, 0.101, radius_m=5.0, logit=20.0), camera, SE3.identity())
    np.testing.assert_allclose(view.silhouette, 0.99, atol=1e-3)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), yaw=st.floats(-3.1, 3.1))
@example(seed=4405, yaw=0.0)  # a disc seen from its edge, whose chord rounds to more than its reach
@PRIMITIVES
def test_sums_are_bounded_and_culling_changes_nothing(primitive: Primitive, seed: int, yaw: float) -> None:
    """From any side: 0 <= A <= 1, C within A times the brightest colour, and the reference agrees."""
    gaussians = scene(60, seed, primitive=primitive)
    pose = level_camera_pose(0.3, -0.2, 1.0, yaw)
    view = render(gaussians, CAMERA, pose)
    assert view.silhouette.min() >= 0.0
    assert view.silhouette.max() <= 1.0
    assert np.all(view.colour_sum <= view.silhouette[..., None] + 1e-5)
    reference = render(gaussians, CAMERA, pose, backend="torch")
    difference = np.abs(view.silhouette - reference.silhouette)
    # Where a splat comes within rounding of 1/255, one may draw it and the other not (seed 686, yaw 0.95).
    assert np.count_nonzero(difference > 5e-5) <= 1
    assert difference.max() < 1.01 / 255


def test_block_culling_drops_only_what_cannot_be_seen() -> None:
    """Compact blocks all round: real bounds and bounds that hold everything give the same picture."""
    rng = np.random.default_rng(8)
    gaussians = GaussianMap()
    for azimuth in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
        middle = POSE.translation + 2.0 * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        rows = np.empty((256, 8), np.float32)
        rows[:, :3] = middle + rng.normal(0.0, 0.1, (256, 3))
        rows[:, 3:6] = rng.uniform(0.0, 1.0, (256, 3))
        rows[:, 6] = np.log(0.05)
        rows[:, 7] = 1.0
        gaussians.append(rows, anchor_keyframe=0)
    culled = render(gaussians, CAMERA, POSE)
    gaussians.block_bounds = np.tile(np.array([-99, -99, -99, 99, 99, 99], np.float32), (24, 1))
    everything = render(gaussians, CAMERA, POSE)
    np.testing.assert_array_equal(culled.colour_sum, everything.colour_sum)
    np.testing.assert_array_equal(culled.depth_sum, everything.depth_sum)
    assert culled.silhouette.max() > 0.9


@PRIMITIVES
def test_the_number_of_threads_changes_nothing(primitive: Primitive) -> None:
    gaussians = scene(700, seed=1, primitive=primitive)
    shape = (CAMERA.height, CAMERA.width)
    incoming = np.ones((*shape, 3), np.float32), np.ones(shape, np.float32), np.ones(shape, np.float32)
    threads = kernels.threads()
    try:
        kernels.set_threads(1)
        view_1, gradient_1 = (
            render(gaussians, CAMERA, POSE),
            NativeBackend().backward(gaussians, CAMERA, POSE, *incoming),
        )
        kernels.set_threads(3)
        view_3, gradient_3 = (
            render(gaussians, CAMERA, POSE),
            NativeBackend().backward(gaussians, CAMERA, POSE, *incoming),
        )
    finally:
        kernels.set_threads(threads)
    np.testing.assert_array_equal(view_1.colour_sum, view_3.colour_sum)
    np.testing.assert_array_equal(gradient_1.parameters, gradient_3.parameters)
    np.testing.assert_array_equal(gradient_1.normals, gradient_3.normals)


def test_an_unknown_backend_is_told_what_there_is() -> None:
    with pytest.raises(ConfigError, match=r"'cuda'.*native, torch"):
        render(GaussianMap(), CAMERA, POSE, backend="cuda")


@PRIMITIVES
def test_what_the_measured_surface_hides_is_left_out_and_nothing_else(primitive: Primitive) -> None:
    """A wall at 1.5 m fills the two columns of tiles on the left; elsewhere nothing is in range."""
    rng = np.random.default_rng(4)
    camera, n = CameraIntrinsics.centred(96, 64, 60.0), 3 * BLOCK
    depth = np.sort(rng.uniform(1.0, 5.0, n))  # blocks are layers of depth
    centres = np.column_stack([rng.uniform(-0.8, 0.8, (n, 2)) * depth[:, None], depth])
    other = [rng.uniform(0.0, 1.0, (n, 3)), rng.normal(-3.5, 0.3, n), rng.normal(0.0, 1.5, n)]
    gaussians = gaussian_map(primitive, np.column_stack([centres, *other]), rng)
    surface = np.full((64, 96), np.inf, np.float32)
    surface[:, :32] = 1.5
    seen = render(gaussians, camera, SE3.identity(), surface_m=surface)
    everything = render(gaussians, camera, SE3.identity())
    in_front = render(gaussians, camera, SE3.identity(), far_m=1.8)
    np.testing.assert_array_equal(seen.colour_sum[:, 32:], everything.colour_sum[:, 32:])
    np.testing.assert_array_equal(seen.colour_sum[:, :32], in_front.colour_sum[:, :32])
    assert not np.array_equal(everything.colour_sum[:, :32], in_front.colour_sum[:, :32])
    surface[40, 20] = 0.0  # not measured
    seen = render(gaussians, camera, SE3.identity(), surface_m=surface)
    np.testing.assert_array_equal(seen.silhouette[32:48, 16:32], everything.silhouette[32:48, 16:32])
