"""The fused step against autograd and Adam written down, and what it must leave alone."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from jaxtyping import Float32, UInt8
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import BLOCK, LOG_RADIUS, GaussianMap, Primitive
from hgs_core.gaussians.optimise import LearningRates, LossWeights, optimise_step
from hgs_core.gaussians.render import render
from hgs_core.gaussians.torch_backend import splat
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from tests.gaussians.maps import PRIMITIVES, gaussian_map

CAMERA = CameraIntrinsics(width=45, height=35, fx=40.0, fy=40.0, cx=22.0, cy=18.0)
POSE = level_camera_pose(0.5, 0.5, 1.0, 0.4)
WEIGHTS = LossWeights()
RATES = LearningRates()


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    rgb: UInt8[ndarray, "height width 3"]
    depth_m: Float32[ndarray, "height width"]


def scene(n: int = 150, seed: int = 0, primitive: Primitive = "isotropic") -> GaussianMap:
    rng = np.random.default_rng(seed)
    depth = np.linspace(1.0, 4.0, n) + rng.uniform(0.1, 0.4, n) * 3.0 / n
    centres = POSE.apply(np.column_stack([rng.uniform(-0.7, 0.7, (n, 2)) * depth[:, None], depth]))
    other = [rng.uniform(0.0, 1.0, (n, 3)), rng.normal(-2.5, 0.4, n), rng.normal(0.0, 1.5, n)]
    return gaussian_map(primitive, np.column_stack([centres, *other])[rng.permutation(n)], rng)


def target(seed: int = 1) -> View:
    rng = np.random.default_rng(seed)
    shape = (CAMERA.height, CAMERA.width)
    depth = rng.uniform(1.0, 4.0, shape).astype(np.float32)
    depth[rng.random(shape) < 0.1] = 0.0
    depth[rng.random(shape) < 0.1] = np.inf
    return View(rgb=rng.integers(0, 256, (*shape, 3), dtype=np.uint8), depth_m=depth)


def step(gaussians: GaussianMap, view: View, rates: LearningRates = RATES) -> float:
    loss = optimise_step(gaussians, view.rgb, view.depth_m, CAMERA, POSE, weights=WEIGHTS, rates=rates)
    return loss.total


@dataclass(kw_only=True, eq=False)
class Moved:
    """Rows that Adam moves, and what it keeps of them."""

    rows: torch.Tensor
    rates: torch.Tensor
    m: torch.Tensor
    v: torch.Tensor

    @staticmethod
    def of(rows: ndarray, rates: list[float]) -> Moved:
        start = torch.from_numpy(rows.copy()).double()
        nought = torch.zeros_like(start)
        return Moved(rows=start, rates=torch.tensor(rates).double(), m=nought, v=nought.clone())

    def step(self, gradient: torch.Tensor, moved: torch.Tensor, t: torch.Tensor) -> None:
        g = gradient[moved]
        self.m[moved] = RATES.beta1 * self.m[moved] + (1 - RATES.beta1) * g
        self.v[moved] = RATES.beta2 * self.v[moved] + (1 - RATES.beta2) * g**2
        m_hat = self.m[moved] / (1 - RATES.beta1**t)
        v_hat = self.v[moved] / (1 - RATES.beta2**t)
        self.rows[moved] -= self.rates * m_hat / (v_hat.sqrt() + RATES.epsilon)


class ReferenceOptimiser:
    """The same loss by autograd in float64, and Adam per Gaussian as its paper writes it."""

    def __init__(self, gaussians: GaussianMap) -> None:
        by_parameter = [*[RATES.centre] * 3, *[RATES.rgb] * 3, RATES.log_radius, RATES.logit_opacity]
        normals = gaussians.normals[: gaussians.size]
        self.parameters = Moved.of(gaussians.parameters[: gaussians.size], by_parameter)
        self.normals = Moved.of(normals, [RATES.normal] * normals.shape[1])
        self.steps = torch.zeros(gaussians.size, dtype=torch.int64)

    def step(self, view: View) -> float:
        leaf = self.parameters.rows.clone().requires_grad_()
        normals = self.normals.rows.clone().requires_grad_()
        colour, depth, silhouette = splat(leaf, normals, CAMERA, POSE)
        truth_rgb = torch.from_numpy(view.rgb).double() / 255.0
        truth_depth = torch.from_numpy(view.depth_m).double()
        valid = (truth_depth > 0) & torch.isfinite(truth_depth)
        covered = valid & (silhouette > 0.05)
        A = silhouette[covered]
        loss = (
            WEIGHTS.colour * (colour[covered] / A[:, None] - truth_rgb[covered]).abs().mean(dim=1).sum()
            + WEIGHTS.depth * (depth[covered] / A - truth_depth[covered]).abs().sum()
            + WEIGHTS.silhouette * ((1.0 - silhouette[valid]) ** 2).sum()
            + WEIGHTS.free * (silhouette[truth_depth == np.inf] ** 2).sum()
        ) / valid.sum()
        by_parameters, by_normals = torch.autograd.grad(
            loss, (leaf, normals), allow_unused=True, materialize_grads=True
        )
        moved = (by_parameters != 0).any(dim=1)
        self.steps[moved] += 1
        t = self.steps[moved, None].double()
        self.parameters.step(by_parameters, moved, t)
        self.normals.step(by_normals, moved, t)
        self.normals.rows /= self.normals.rows.norm(dim=1, keepdim=True)
        return float(loss.detach())


@PRIMITIVES
def test_steps_are_those_of_autograd_and_adam(primitive: Primitive) -> None:
    """Moments are compared by size, parameters by that of a step: where a gradient is all but zero, Adam
    turns its rounding into a full step, so a small share of entries may differ by up to that."""
    gaussians, view = scene(primitive=primitive), target()
    reference, size = ReferenceOptimiser(gaussians), gaussians.size
    for number in range(3):
        loss = step(gaussians, view)
        assert loss == pytest.approx(reference.step(view), rel=1e-5)
        np.testing.assert_array_equal(gaussians.adam_steps[:size], reference.steps.numpy())
        for first, second, rows, truth in (
            (
                gaussians.adam_first_moment,
                gaussians.adam_second_moment,
                gaussians.parameters,
                reference.parameters,
            ),
            (
                gaussians.normal_first_moment,
                gaussians.normal_second_moment,
                gaussians.normals,
                reference.normals,
            ),
        ):
            for mine, moment in ((first, truth.m), (second, truth.v)):
                scale = moment.abs().amax(dim=0).numpy()
                np.testing.assert_allclose(
                    mine[:size] / scale, moment.numpy() / scale, atol=1e-4 * (number + 1)
                )
            difference = np.abs(rows[:size] - truth.rows.numpy())
            off = difference > 0.02 * truth.rates.numpy() + 2e-7
            assert off.sum() <= 0.01 * off.size
            assert np.all(difference <= 2.1 * (number + 1) * truth.rates.numpy() + 1e-6)
    assert 50 < np.count_nonzero(gaussians.adam_steps[:size] == 3) < size
    np.testing.assert_allclose(
        np.linalg.norm(gaussians.normals[:size], axis=1), primitive == "disc", rtol=1e-6
    )


def test_reported_terms_are_means_over_covered_pixels() -> None:
    gaussians, view = scene(), target()
    drawn = render(gaussians, CAMERA, POSE)
    valid = (view.depth_m > 0) & np.isfinite(view.depth_m)
    covered = valid & (drawn.silhouette > 0.05)
    loss = optimise_step(gaussians, view.rgb, view.depth_m, CAMERA, POSE, weights=WEIGHTS, rates=RATES)
    assert loss.pixels == np.count_nonzero(valid)
    assert loss.covered_pixels == np.count_nonzero(covered)
    colour_error = np.abs(drawn.colour - view.rgb / 255.0)[covered].mean()
    depth_error = np.abs(drawn.depth_m - view.depth_m)[covered].mean()
    assert loss.colour_l1 == pytest.approx(colour_error, rel=1e-4)
    assert loss.depth_l1_m == pytest.approx(depth_error, rel=1e-4)
    share = loss.covered_pixels / loss.pixels
    expected = (
        share * (WEIGHTS.colour * colour_error + WEIGHTS.depth * depth_error)
        + WEIGHTS.silhouette * ((1.0 - drawn.silhouette[valid]) ** 2).mean()
        + WEIGHTS.free * (drawn.silhouette[np.isinf(view.depth_m)] ** 2).sum() / loss.pixels
    )
    assert loss.total == pytest.approx(expected, rel=1e-4)


def test_what_lies_far_behind_the_farthest_depth_is_left_out() -> None:
    near, both, view = scene(), scene(), target()
    farthest = view.depth_m[np.isfinite(view.depth_m)].max()
    behind = np.zeros((2, 8), np.float32)
    behind[:, :3] = POSE.apply(np.array([[0.0, 0.0, farthest + 0.29], [0.0, 0.0, farthest + 0.31]]))
    behind[:, 3:] = [1.0, 0.0, 0.0, -1.0, 2.0]
    near.append(behind[:1], anchor_keyframe=0)
    both.append(behind, anchor_keyframe=0)
    assert step(near, view) == step(both, view)
    np.testing.assert_array_equal(both.parameters[: near.size], near.parameters[: near.size])
    assert both.adam_steps[near.size - 1] == 1
    assert both.adam_steps[near.size] == 0


@PRIMITIVES
def test_what_a_surface_in_front_hides_is_left_out(primitive: Primitive) -> None:
    """A wall at 1.5 m over the two tiles on the left, 4 m of free view beside it."""
    view = target()
    view.depth_m[:] = 4.0
    view.depth_m[:, :32] = 1.5
    gaussians = scene(primitive=primitive)
    rows = gaussians.parameters[: gaussians.size]
    in_camera = POSE.inverse().apply(rows[:, :3].astype(np.float64))
    column = CAMERA.fx * in_camera[:, 0] / in_camera[:, 2] + CAMERA.cx
    widest_px = 4.0 * CAMERA.fx * np.exp(rows[:, LOG_RADIUS]) / in_camera[:, 2] + 3.0
    hidden = (in_camera[:, 2] > 1.81) & (column + widest_px < 32) & (widest_px < 20)
    assert hidden.sum() > 10
    without = gaussian_map(primitive, rows[~hidden], np.random.default_rng(0))
    without.normals[: without.size] = gaussians.normals[: gaussians.size][~hidden]
    before = rows[hidden].copy()
    assert step(gaussians, view) == pytest.approx(step(without, view), rel=1e-6)
    np.testing.assert_array_equal(rows[hidden], before)
    assert not gaussians.adam_steps[: gaussians.size][hidden].any()
    np.testing.assert_allclose(rows[~hidden], without.parameters[: without.size], rtol=1e-5, atol=1e-6)


def test_nothing_is_hidden_where_a_pixel_was_not_measured() -> None:
    view = target()
    view.depth_m[:] = 4.0
    view.depth_m[:, :32] = 1.5
    view.depth_m[20, 20] = 0.0
    gaussians = scene(1)
    gaussians.parameters[0, :3] = POSE.apply(np.array([0.0, 0.0, 3.0]))
    gaussians.refresh_blocks()
    step(gaussians, view)
    assert gaussians.adam_steps[0] == 1


@PRIMITIVES
def test_repeated_steps_learn_a_picture(primitive: Primitive) -> None:
    """A map that differs from the truth in colour, radius and opacity comes back to its picture."""
    truth = scene(200, seed=3, primitive=primitive)
    truth.parameters[:200, 6:] = [-1.8, 4.0]
    drawn = render(truth, CAMERA, POSE)
    rgb = np.clip(np.rint(drawn.colour * 255.0), 0, 255).astype(np.uint8)
    view = View(rgb=rgb, depth_m=np.where(drawn.silhouette > 0.9, drawn.depth_m, 0).astype(np.float32))
    gaussians = copy.deepcopy(truth)
    rng = np.random.default_rng(4)
    gaussians.parameters[:200, 3:6] = rng.uniform(0.0, 1.0, (200, 3))
    gaussians.parameters[:200, LOG_RADIUS] += 0.1
    gaussians.refresh_blocks()
    first = step(gaussians, view)
    for _ in range(200):
        last = step(gaussians, view)
    assert last < 0.4 * first


@PRIMITIVES
def test_what_is_not_seen_does_not_move(primitive: Primitive) -> None:
    gaussians, view = scene(primitive=primitive), target()
    behind = np.full((300, 8), 0.5, np.float32)
    behind[:, :3] = POSE.apply(np.array([[0.0, 0.0, -3.0]]))
    gaussians.append(
        behind, gaussian_map(primitive, behind, np.random.default_rng(0)).normals[:300], anchor_keyframe=1
    )
    before = copy.deepcopy(gaussians.state())
    step(gaussians, view)
    after = gaussians.state()
    still = after["adam_steps"] == 0
    assert still[150:].all()
    moved = ["parameters", "adam_first_moment", "adam_second_moment"]
    moved += ["normals", "normal_first_moment", "normal_second_moment"] if primitive == "disc" else []
    for name in moved:
        np.testing.assert_array_equal(before[name][still], after[name][still])
        assert not np.array_equal(before[name][~still], after[name][~still])
    for name in ("information", "anchor_keyframe", "n_depth_observations"):
        np.testing.assert_array_equal(before[name], after[name])
    assert after["version"] > before["version"]


def test_no_valid_pixel_moves_nothing() -> None:
    gaussians = scene()
    before = gaussians.parameters.copy()
    depth = np.full((CAMERA.height, CAMERA.width), np.inf, np.float32)
    loss = optimise_step(gaussians, target().rgb, depth, CAMERA, POSE, weights=WEIGHTS, rates=RATES)
    assert (loss.pixels, loss.covered_pixels, loss.total) == (0, 0, 0.0)
    np.testing.assert_array_equal(gaussians.parameters, before)


def test_radii_stay_within_their_limits() -> None:
    gaussians, view = scene(), target()
    rates = LearningRates(log_radius=5.0)
    limits = (0.05, 0.12)
    for _ in range(3):
        optimise_step(
            gaussians,
            view.rgb,
            view.depth_m,
            CAMERA,
            POSE,
            weights=WEIGHTS,
            rates=rates,
            radius_limits_m=limits,
        )
    moved = gaussians.adam_steps[: gaussians.size] > 0
    radii = gaussians.radii_m[moved]
    assert radii.min() >= 0.05 * (1 - 1e-5)
    assert radii.max() <= 0.12 * (1 + 1e-5)


def test_block_bounds_hold_every_gaussian_after_it_moved() -> None:
    gaussians, view = scene(600), target()
    for _ in range(5):
        step(gaussians, view, LearningRates(centre=0.05, log_radius=0.2))
    bounds = gaussians.block_bounds[np.arange(gaussians.size) // BLOCK]
    radii = gaussians.radii_m[:, None]
    assert np.all(bounds[:, :3] <= gaussians.centres_m - radii + 1e-6)
    assert np.all(bounds[:, 3:] >= gaussians.centres_m + radii - 1e-6)


def test_the_number_of_threads_changes_nothing() -> None:
    view = target()
    threads = kernels.threads()
    results = []
    try:
        for n in (1, 3):
            kernels.set_threads(n)
            gaussians = scene(600)
            results.append([step(gaussians, view), step(gaussians, view), gaussians.parameters.copy()])
    finally:
        kernels.set_threads(threads)
    assert results[0][:2] == results[1][:2]
    np.testing.assert_array_equal(results[0][2], results[1][2])


def test_images_that_do_not_fit_the_camera_are_refused() -> None:
    view = target()
    with pytest.raises(MapError, match=r"\(35, 45\)"):
        optimise_step(scene(), view.rgb[1:], view.depth_m[1:], CAMERA, POSE, weights=WEIGHTS, rates=RATES)
    with pytest.raises(MapError, match="radius_limits_m"):
        optimise_step(
            scene(),
            view.rgb,
            view.depth_m,
            CAMERA,
            POSE,
            weights=WEIGHTS,
            rates=RATES,
            radius_limits_m=(1.0, 0.5),
        )
