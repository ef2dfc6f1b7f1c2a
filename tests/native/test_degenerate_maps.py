"""The kernels of maps and pictures at the edge of what they take: rows, rays, depths and triangles that are
no numbers, lie nowhere or have no extent. See `test_degenerate_floors`.
"""

import numpy as np
import pytest

from hgs_core.native import kernels

BEYOND = [1e10, 1e12, -1e12, 1e300, -1e300, 1.7e308]


def wild_gaussians(rng: np.random.Generator, n: int) -> np.ndarray:
    """A map's rows about the origin, some of them far off, huge, or no numbers."""
    rows = rng.normal(0, 1, (n, 8)).astype(np.float32)
    rows[:, 6] = rng.normal(-3, 1, n)
    for _ in range(n // 5):
        rows[rng.integers(n), rng.integers(8)] = rng.choice([np.nan, np.inf, -np.inf, 1e30, -1e30, 80.0])
    return rows


def bounds_of(rows: np.ndarray) -> np.ndarray:
    bounds = np.empty((-(-len(rows) // 256), 6), np.float32)
    kernels.bound_blocks(rows, 256, bounds)
    return bounds


@pytest.mark.parametrize("n", [0, 1, 255, 256, 257, 700])
def test_gaussians_that_lie_nowhere_are_counted_nowhere(n):
    rng = np.random.default_rng(n)
    rows = wild_gaussians(rng, n)
    bounds = bounds_of(rows)
    everywhere = np.tile(np.array([-np.inf, np.inf], np.float32).repeat(3), (len(bounds), 1))
    for shape in ((0, 0), (1, 1), (9, 7)):
        for box in (bounds, everywhere):
            counts = np.zeros(shape, np.int32)
            layer = [-1.0, 1.0, -1.0, -1.0, -1.0, 0.3]
            kernels.count_in_layer(rows, box, layer, counts)
            assert 0 <= counts.sum() <= n
            near, mask = np.zeros(shape, np.int32), np.ones(shape, np.uint8)
            kernels.count_in_reach(rows, box, layer, mask, mask, 2.5, near)
            np.testing.assert_array_equal(
                near, counts
            )  # every cell's middle is within a cell of what is in it
        counts = np.zeros((*shape, 5), np.int32)
        kernels.count_by_voxel(rows, -1.0, [-3, -3, -3], 0.3, counts)
        assert 0 <= counts.sum() <= n
        kept = np.zeros(n, bool)
        states = rng.integers(0, 3, (*shape, 5)).astype(np.uint8)
        kernels.flag_worth_keeping(rows, -1.0, states, [-3, -3, -3], 0.3, kept)
        assert not kept[rows[:, 7] < -1.0].any()


@pytest.mark.parametrize("n", [0, 1, 257, 700])
@pytest.mark.parametrize("discs", [False, True])
def test_gain_of_a_map_with_rows_that_are_no_numbers(n, discs):
    rng = np.random.default_rng(n)
    rows = wild_gaussians(rng, n)
    bounds = np.tile(np.array([-np.inf, np.inf], np.float32).repeat(3), (-(-n // 256), 1))
    normals = rng.normal(size=(n, 3)).astype(np.float32) if discs else np.zeros((n, 0), np.float32)
    shape, edge = (21, 18, 9), kernels.GAIN_CHUNK
    chunks = (-(-shape[0] // edge), -(-shape[1] // edge))
    lower, wanted = np.array([-2.0, -2.0, -1.0]), np.ones(chunks, bool)
    cells = np.zeros((*shape, 2), np.float32)
    n_gaussians, n_populated = np.zeros(chunks, np.int64), np.zeros(chunks, np.int64)
    states = rng.integers(0, 3, shape).astype(np.uint8)
    attempts = rng.integers(0, 9, shape).astype(np.uint8)
    kernels.gather_gain(
        rows, bounds, states, attempts, 4, lower, 0.2, 0.005, wanted, cells, n_gaussians, n_populated
    )
    assert 0 <= n_gaussians.sum() <= n
    positions = np.concatenate([rng.uniform(-3, 25, (5, 3)), [[1e9, 0.0, 0.0], [np.nan, 1.0, 1.0]]])
    panoramas = [np.zeros((7, 4, 16), np.float32) for _ in range(3)]
    first = np.zeros((7, 4, 16), np.int32)
    kernels.march_panoramas(
        cells, positions, -0.6, 0.6, 20.0, 5.0, 2.0, *panoramas, first, np.zeros(chunks, bool)
    )
    assert ((first >= -1) & (first < np.prod(shape))).all()
    field = kernels.FisherField(np.array(shape), lower, 0.2, [1.0] * 8, 1e-6, 10.0, 5.0, [0.5, 0.4])
    field.gather(rows, normals, bounds, wanted)
    scores = np.zeros((7, 4, 16, 2), np.float32)
    information = np.zeros_like(rows)
    field.score(rows, normals, information, positions * 0.2 + lower.mean(), -0.6, 0.6, scores)
    field.clear()


@pytest.mark.parametrize("seed", range(3))
def test_rays_into_voxels_from_anywhere_to_anywhere(seed):
    rng = np.random.default_rng(seed)
    for shape in ((1, 1, 1), (7, 5, 3), (33, 20, 9)):
        states, attempts = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
        log_odds = np.zeros(shape, np.float32)
        edge = kernels.VOXEL_CHUNK
        changed = np.zeros((-(-shape[0] // edge), -(-shape[1] // edge)), np.uint8)
        for _ in range(8):
            ends = rng.uniform(-3.0, np.array(shape) + 3.0, (60, 3))
            for _ in range(20):
                ends[rng.integers(60), rng.integers(3)] = rng.choice(
                    [*BEYOND, np.nan, np.inf, -np.inf, 0.0, 1.0]
                )
            origin = rng.uniform(-1.0, np.array(shape) + 1.0)
            if rng.random() < 0.3:
                origin[rng.integers(3)] = rng.choice([np.nan, np.inf, 1e300, 0.0, shape[0]])
            kernels.integrate_rays(
                states, log_odds, origin, ends, rng.random(60) < 0.5, 0.9, -0.4, -2.0, 3.5, changed
            )
            assert not np.isnan(log_odds).any()
            depth = rng.choice([0.0, 1.0, 3.0, np.inf, np.nan, -1.0], (6, 8)).astype(np.float32)
            kernels.count_attempts(
                states, attempts, np.eye(3), origin, 5.0, 5.0, 4.0, 3.0, depth, 6.0, 0.2, 0.0, changed
            )


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (2, 2), (5, 3), (24, 31)])
def test_frames_of_any_size_with_depths_that_are_none(shape):
    rng = np.random.default_rng(0)
    depth = rng.choice([0.0, 1.0, 2.0, np.inf, np.nan, -1.0], shape).astype(np.float32)
    rgb = rng.integers(0, 256, (*shape, 3)).astype(np.uint8)
    half = (shape[0] // 2, shape[1] // 2)
    halved, smoothed = np.zeros(half, np.float32), np.zeros(half, np.float32)
    kernels.halve_frame(rgb, depth, 0.1, np.zeros((*half, 3), np.uint8), halved)
    kernels.smooth_depth(halved, 3, 0.05, smoothed)
    with pytest.raises(ValueError, match="half"):
        kernels.halve_frame(rgb, depth, 0.1, np.zeros((*half, 1), np.uint8), halved)
    with pytest.raises(ValueError, match="differ"):
        kernels.smooth_depth(depth, 3, 0.05, np.zeros((1, 7), np.float32))
    rows = wild_gaussians(rng, 600)
    rows[:, 2] = np.abs(rows[:, 2])
    kernels.fuse_centres(
        rows,
        np.zeros(600, np.uint16),
        np.tile(np.array([-9, 9], np.float32).repeat(3), (3, 1)),
        256,
        np.abs(depth),
        np.ones(shape, np.float32),
        20.0,
        20.0,
        shape[1] / 2,
        shape[0] / 2,
        np.eye(3, dtype=np.float32),
        np.zeros(3, np.float32),
        gate_m=0.1,
        gate_slope=0.02,
        max_count=9,
    )


def test_triangles_without_area_are_shaded_somehow():
    """Textures of 2 x 2 and 1 x 1; rays that meet no triangle, and coordinates that are no numbers."""
    rng = np.random.default_rng(0)
    n = 64
    triangle = rng.choice(np.array([0, 1, 5, 2**32 - 1], np.uint32), n)
    barycentric = rng.choice(np.array([0, 1, 0.3, -1e-9, np.nan, np.inf, 1e30], np.float32), (n, 2))
    z_depth = rng.choice(np.array([0.0, 1.0, 1e30, np.inf, np.nan], np.float32), n)
    facing = rng.choice(np.array([0.0, 0.5, 1.0, np.inf, np.nan], np.float32), n)
    rgb, depth = np.zeros((n, 3), np.uint8), np.zeros(n, np.float32)
    for corner_rgb in (None, rng.integers(0, 256, (2, 3, 3)).astype(np.uint8)):
        kernels.shade(
            triangle,
            barycentric,
            z_depth,
            facing,
            rng.uniform(-2, 2, (2, 3, 2)).astype(np.float32),
            np.array([[1, 1, 1], [5, -1, np.nan]], np.float32),
            np.array([3.0, np.inf], np.float32),
            np.zeros(2, np.int32),
            corner_rgb,
            rng.integers(0, 256, (5, 3)).astype(np.uint8),
            np.array([0, 4], np.int64),
            np.array([2, 1], np.int32),
            np.array([2, 1], np.int32),
            np.zeros(1, np.int32),
            np.full(1, 2, np.int32),
            focal_px=30.0,
            range_m=5.0,
            background=np.array([1, 2, 3], np.uint8),
            rgb=rgb,
            depth_m=depth,
        )
        assert (rgb[triangle >= 2] == [1, 2, 3]).all()
        assert np.isinf(depth[triangle >= 2]).all()


# fx, fy, cx, cy, the camera at the origin looking along z, low pass [px^2], far [m].
CAMERA = [20.0, 20.0, 20.0, 15.0, *np.eye(3, 4).ravel(), 0.3, 50.0]


@pytest.mark.parametrize("discs", [False, True])
@pytest.mark.parametrize("n", [0, 1, 257, 700])
def test_maps_with_rows_that_are_no_numbers_are_drawn(n, discs):
    rng = np.random.default_rng(n)
    rows = wild_gaussians(rng, n)
    rows[:, 2] = np.abs(rows[:, 2])
    normals = rng.normal(size=(n, 3)).astype(np.float32) if discs else np.zeros((n, 0), np.float32)
    if discs and n > 9:
        normals[5] = np.nan
        normals[6] = 0.0
    bounds = np.tile(np.array([-99, 99], np.float32).repeat(3), (-(-n // 256), 1))
    for height, width in ((0, 0), (1, 1), (30, 40)):
        images = [np.zeros((height, width, *channels), np.float32) for channels in ((3,), (), ())]
        kernels.render_sums(rows, normals, bounds, CAMERA, None, *images)
        gradient, of_normals = np.zeros_like(rows), np.zeros_like(normals)
        kernels.render_gradient(rows, normals, bounds, CAMERA, *images, gradient, of_normals)
        if height:
            kernels.add_information(
                rows, normals, bounds, CAMERA, None, width, height, 1.0, np.zeros_like(rows)
            )
            kernels.quality_image(
                rows,
                normals,
                bounds,
                CAMERA,
                np.zeros_like(rows),
                [1.0] * 8,
                np.zeros((height, width), np.float32),
            )
        moved, moved_normals = rows.copy(), normals.copy()
        kernels.optimise_view(
            moved,
            np.zeros_like(rows),
            np.zeros_like(rows),
            moved_normals,
            np.zeros_like(normals),
            np.zeros_like(normals),
            np.zeros(n, np.int32),
            bounds.copy(),
            CAMERA,
            np.zeros((height, width, 3), np.uint8),
            rng.choice([0.0, 1.0, np.inf, np.nan], (height, width)).astype(np.float32),
            [0.8, 0.2, 1.0, 1.0],
            [0.01] * 8 + [0.9, 0.999, 1e-8, -6.0, 1.0, 0.01],
        )
