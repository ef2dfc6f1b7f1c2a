"""Averaging depth into centres: the kernel against a plain loop."""

import numpy as np

from hgs_core.gaussians.gaussian_map import BLOCK, GaussianMap
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.native import kernels

CAMERA = CameraIntrinsics.centred(60, 40, 30.0)
POSE = level_camera_pose(0.3, -0.2, 1.0, 0.4)
GATE_M, SLOPE, MOST = 0.04, 0.008, 40
LARGEST_RADIUS = np.random.default_rng(7).uniform(0.02, 0.15, (40, 60)).astype(np.float32)


def gaussians_near_a_wall(rng: np.random.Generator, n: int) -> GaussianMap:
    """Centres around the plane z = 2 m of the camera, some far from it, some behind the camera."""
    x = rng.uniform(-3, 3, n)
    y = rng.uniform(-2, 2, n)
    z = 2.0 + rng.normal(0, 0.05, n)
    z[: n // 10] = -1.0
    parameters = np.zeros((n, 8), np.float32)
    parameters[:, :3] = POSE.apply(np.stack([x, y, z], axis=1))
    parameters[:, 6] = np.log(rng.uniform(0.005, 0.2, n))
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    gaussians.n_depth_observations[:n] = rng.integers(1, 60, n)
    return gaussians


def fuse(
    gaussians: GaussianMap, depth: np.ndarray, pose: SE3, *, gate_m: float = GATE_M, slope: float = SLOPE
) -> np.ndarray:
    size = gaussians.size
    return kernels.fuse_centres(
        gaussians.parameters[:size],
        gaussians.n_depth_observations[:size],
        gaussians.block_bounds,
        BLOCK,
        depth.astype(np.float32),
        LARGEST_RADIUS,
        CAMERA.fx,
        CAMERA.fy,
        CAMERA.cx,
        CAMERA.cy,
        pose.rotation.astype(np.float32),
        pose.translation.astype(np.float32),
        gate_m=gate_m,
        gate_slope=slope,
        max_count=MOST,
    )


def naive(parameters: np.ndarray, counts: np.ndarray, wall_m: float) -> tuple[np.ndarray, list[int]]:
    """One Gaussian at a time against a wall of constant depth."""
    moved, coarse = parameters.copy(), []
    camera_points = POSE.inverse().apply(parameters[:, :3].astype(float))
    for i, (x, y, z) in enumerate(camera_points):
        if z < 0.1:
            continue
        gate = GATE_M + SLOPE * z
        u, v = CAMERA.fx * x / z + CAMERA.cx, CAMERA.fy * y / z + CAMERA.cy
        hidden = wall_m < z - gate
        if 0 <= u < CAMERA.width and 0 <= v < CAMERA.height and not hidden:
            limit = LARGEST_RADIUS[int(v), int(u)] * min(1.0, z / wall_m)
            if np.exp(parameters[i, 6]) > limit:
                coarse.append(i)
        whole = 0.5 <= u < CAMERA.width - 0.5 and 0.5 <= v < CAMERA.height - 0.5
        if whole and abs(wall_m - z) <= gate:
            fused = z + (wall_m - z) / (min(counts[i], MOST) + 1)
            moved[i, :3] = POSE.apply(np.array([[x, y, z]]) * fused / z)[0]
    return moved, coarse


def test_centres_move_as_in_a_plain_loop() -> None:
    gaussians = gaussians_near_a_wall(np.random.default_rng(1), 1000)
    before = gaussians.parameters[:1000].copy()
    counts = gaussians.n_depth_observations[:1000].copy()
    expected, coarse = naive(before, counts, 2.0)
    rows = fuse(gaussians, np.full((40, 60), 2.0), POSE)
    np.testing.assert_allclose(gaussians.parameters[:1000], expected, atol=2e-6)
    assert rows.tolist() == coarse
    touched = np.any(expected != before, axis=1)
    assert 100 < touched.sum() < 900
    assert np.array_equal(gaussians.n_depth_observations[:1000] > counts, touched)


def test_wide_gaussians_at_a_border_are_coarse_though_their_pixel_shows_what_is_behind() -> None:
    """One column before a wall: wider than this view would make it, finer, and hidden by the wall."""
    parameters = np.zeros((3, 8), np.float32)
    parameters[:, :3] = POSE.apply(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 3.5]]))
    u, v = int(CAMERA.cx), int(CAMERA.cy)
    limit = LARGEST_RADIUS[v, u] * 1.0 / 3.0  # what a radius at the wall's 3 m spans in the image, at 1 m
    parameters[:, 6] = np.log([1.05 * limit, 0.95 * limit, 10.0])
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    assert fuse(gaussians, np.full((40, 60), 3.0), POSE).tolist() == [0]


def test_nothing_moves_without_a_measurement() -> None:
    gaussians = gaussians_near_a_wall(np.random.default_rng(2), 500)
    before = gaussians.parameters[:500].copy()
    for empty in (0.0, np.inf):
        assert len(fuse(gaussians, np.full((40, 60), empty), POSE)) == 0
    np.testing.assert_array_equal(gaussians.parameters[:500], before)


def test_without_a_gate_no_centre_is_averaged() -> None:
    rng = np.random.default_rng(3)
    gaussians = gaussians_near_a_wall(rng, 500)
    before = gaussians.parameters[:500].copy()
    counts = gaussians.n_depth_observations[:500].copy()
    fuse(gaussians, np.full((40, 60), 2.0), POSE, gate_m=0.0, slope=0.0)
    np.testing.assert_array_equal(gaussians.parameters[:500], before)
    np.testing.assert_array_equal(gaussians.n_depth_observations[:500], counts)
