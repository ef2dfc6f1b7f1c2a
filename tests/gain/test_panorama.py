import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgs_core.gain.field import CHUNK, OPTICAL_DEPTH, UNSEEN, GainField
from hgs_core.gain.panorama import PanoramaGrid, by_yaw, march
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.native import kernels
from hgs_core.voxels.voxel_map import VoxelState
from tests.gain import naive
from tests.gain.worlds import CAMERA, empty_voxels, gaussians_at, snapshot_of


def random_field(rng: np.random.Generator) -> GainField:
    shape = tuple(rng.integers(3, 9, 3))
    cells = np.zeros((*shape, 2), np.float32)
    kind = rng.choice(4, shape, p=[0.55, 0.25, 0.1, 0.1])
    cells[..., OPTICAL_DEPTH] = np.choose(kind, [0.0, 0.0, np.inf, rng.uniform(0.1, 2, shape)])
    cells[..., UNSEEN] = (kind == 1) * rng.choice([1.0, 0.4, 6.0], shape)
    n_chunks = (1, 1)
    return GainField(
        first_index=rng.integers(-4, 4, 3),
        size_m=0.1,
        cells=cells,
        n_gaussians=np.full(n_chunks, 100),
        n_populated=np.ones(n_chunks, int),
        is_gathered=np.ones(n_chunks, bool),
    )


@given(seed=st.integers(0, 10_000), free_path_m=st.sampled_from([np.inf, 0.8, 0.07]))
@settings(max_examples=16)
def test_the_march_is_that_of_the_oracle(seed: int, free_path_m: float) -> None:
    rng = np.random.default_rng(seed)
    field, size, range_m = random_field(rng), 0.1, 1.1
    grid = PanoramaGrid.for_camera(CAMERA, n_azimuths=24, n_elevations=8)
    low = field.first_index * size
    positions = low + rng.uniform(-0.2, 1.2, (3, 3)) * size * np.array(field.cells.shape[:3])
    panoramas = march(grid, field, positions, range_m=range_m, free_path_m=free_path_m)
    for i, position in enumerate(positions):
        volume, voxels, surface, first = naive.march_one(
            grid, field, position, range_m=range_m, free_path_m=free_path_m
        )
        for marched, expected in (
            (panoramas.unseen_volume_m3[i], volume),
            (panoramas.unseen_voxels[i], voxels),
            (panoramas.new_surface_m2[i], surface),
        ):
            # Crossings are known to a float's precision: a voxel that is barely touched to less.
            np.testing.assert_allclose(marched, expected, rtol=1e-4, atol=1e-5 * max(expected.max(), 1e-3))
        assert np.mean(panoramas.first_unseen[i] == first) > 0.97  # but where a corner is barely touched


def random_maps(rng: np.random.Generator) -> MapSnapshot:
    """Gaussians of any kind in and around voxels of any kind."""
    n = int(rng.integers(1, 3000))
    gaussians = gaussians_at(rng.uniform(-0.2, 4.9, (n, 3)) * [1.0, 1.0, 0.2], radius_m=0.02)
    gaussians.parameters[:n, 7] = rng.uniform(-8, 4, n)
    voxels = empty_voxels((4.0, 3.7, 0.5))
    voxels.states[:] = rng.choice(3, voxels.states.shape)
    voxels.attempts[:] = rng.integers(0, 5, voxels.states.shape)
    return snapshot_of(voxels, gaussians)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=10)
def test_gathering_is_that_of_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    snapshot = random_maps(rng)
    voxels = snapshot.voxels
    field = GainField.over(voxels)
    chunks = rng.random(field.is_gathered.shape) < 0.6
    field.gather(snapshot, chunks)
    depth, count = naive.gathered(snapshot.gaussians, voxels.lower_m(), voxels.states.shape, 0.1)
    dismissed = (voxels.states == VoxelState.UNOBSERVED) & (voxels.attempts >= voxels.config.max_attempts)
    depth[dismissed | (voxels.states == VoxelState.OCCUPIED)] = np.inf
    unseen = (voxels.states == VoxelState.UNOBSERVED) & ~dismissed
    i, j = np.indices(voxels.states.shape)[:2]
    filled = chunks[i // CHUNK, j // CHUNK]
    np.testing.assert_allclose(field.cells[..., OPTICAL_DEPTH], np.where(filled, depth, 0), rtol=1e-4)
    np.testing.assert_array_equal(field.cells[..., UNSEEN], unseen & filled)
    expected = count[filled].sum() / max(np.count_nonzero(count[filled]), 1) / 0.01
    assert field.gaussians_per_m2(chunks) == pytest.approx(expected)


def test_chunks_gathered_one_by_one_hold_what_they_hold_together() -> None:
    snapshot = random_maps(np.random.default_rng(5))
    whole, parts = GainField.over(snapshot.voxels), GainField.over(snapshot.voxels)
    whole.gather(snapshot, np.ones_like(whole.is_gathered))
    for chunk in np.argwhere(np.ones_like(parts.is_gathered)):
        one = np.zeros_like(parts.is_gathered)
        one[tuple(chunk)] = True
        parts.gather(snapshot, one)
    np.testing.assert_array_equal(whole.cells, parts.cells)
    np.testing.assert_array_equal(whole.n_gaussians, parts.n_gaussians)
    assert parts.is_gathered.all()


def test_gathered_sums_do_not_depend_on_the_threads() -> None:
    snapshot = random_maps(np.random.default_rng(6))
    fields = []
    threads = kernels.threads()
    for n in (1, 2, 3):
        kernels.set_threads(n)
        fields.append(GainField.over(snapshot.voxels))
        fields[-1].gather(snapshot, np.ones_like(fields[-1].is_gathered))
    kernels.set_threads(threads)
    for other in fields[1:]:
        np.testing.assert_array_equal(fields[0].cells, other.cells)


def test_only_chunks_in_reach_are_near() -> None:
    field = GainField.over(empty_voxels((8.0, 6.4, 1.0)))
    near = field.chunks_near(np.array([[0.8, 0.8, 0.5], [7.9, 6.3, 0.5]]), 0.7)
    np.testing.assert_array_equal(np.argwhere(near), [[0, 0], [4, 3]])
    assert not field.chunks_near(np.array([[99.0, -99.0, 0.0]]), 5.0).any()


@pytest.mark.parametrize(
    "camera",
    [CAMERA, CameraIntrinsics(width=640, height=480, fx=300.0, fy=310.0, cx=250.0, cy=300.0)],
    ids=["centred", "off-centre"],
)
def test_the_window_is_what_the_pinhole_sees(camera: CameraIntrinsics) -> None:
    grid = PanoramaGrid.for_camera(camera, n_azimuths=72, n_elevations=24)
    k = 17  # any yaw
    pose = level_camera_pose(0.0, 0.0, 0.0, float(grid.yaws_rad[k]))
    step, rows = grid.azimuth_step_rad, np.arange(24)
    u = grid.tan_low + (rows + 0.5) * (grid.tan_high - grid.tan_low) / 24
    parts = (np.arange(40) + 0.5) / 40
    window = grid.window()
    for a in range(72):
        phi = -np.pi + (a + parts) * step
        points = np.stack(np.broadcast_arrays(np.cos(phi), np.sin(phi), u[:, None]), axis=-1)
        inside = camera.project(pose.inverse().apply(points.reshape(-1, 3)))[1].reshape(24, 40)
        np.testing.assert_allclose(window[:, (a - k) % 72], inside.mean(axis=1), atol=0.051)


def test_a_window_of_a_power_weighs_directions_by_their_angle_off_the_axis() -> None:
    grid = PanoramaGrid.for_camera(CAMERA, n_azimuths=24, n_elevations=4)
    # Rows near the horizon see all bins from -45 to 45 degrees: the integral of 1 / cos^2 is 2.
    np.testing.assert_allclose(grid.window(2)[1].sum() * grid.azimuth_step_rad, 2.0, rtol=1e-6)
    np.testing.assert_allclose(grid.window(0)[1].sum() * grid.azimuth_step_rad, np.pi / 2, rtol=1e-6)


def test_sliding_the_window_is_a_sum_over_what_it_covers() -> None:
    rng = np.random.default_rng(0)
    panoramas, window = rng.random((2, 3, 8)).astype(np.float32), np.zeros((3, 8))
    window[:, [0, 1, 7]] = rng.random((3, 3))
    expected = [
        [
            sum(window[e, m] * panoramas[n, e, (k + m) % 8] for e in range(3) for m in range(8))
            for k in range(8)
        ]
        for n in range(2)
    ]
    np.testing.assert_allclose(by_yaw(panoramas, window), expected)
