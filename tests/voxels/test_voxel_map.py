import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.errors import MapError
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState
from tests.voxels import naive

CAMERA = CameraIntrinsics.centred(240, 192, 144.0)


def frame_of(depth: ndarray, pose: SE3, camera: CameraIntrinsics = CAMERA) -> Frame:
    return Frame(
        rgb=np.zeros((camera.height, camera.width, 3), np.uint8),
        depth_m=depth.astype(np.float32),
        intrinsics=camera,
        T_world_camera=pose,
        timestamp_s=0.0,
        sequence=0,
    )


def flat_wall(distance_m: float, camera: CameraIntrinsics = CAMERA) -> ndarray:
    return np.full((camera.height, camera.width), distance_m)


def state_at(voxels: VoxelMap, *point_m: float) -> VoxelState:
    index, inside = voxels.index_of(np.array([point_m]))
    return VoxelState(int(voxels.states[tuple(index[0])])) if inside[0] else VoxelState.UNOBSERVED


def tilted_pose(rng: np.random.Generator, centre: ndarray) -> SE3:
    twist = np.concatenate([np.zeros(3), rng.uniform(-3, 3, 3)])
    return SE3(rotation=SE3.exp(twist).rotation, translation=centre + rng.uniform(-0.4, 0.4, 3))


# ---------------------------------------------------------------- laws


def test_space_before_a_wall_is_free_the_wall_occupied_and_behind_it_unknown() -> None:
    voxels = VoxelMap(VoxelConfig())
    voxels.integrate_frame(frame_of(flat_wall(2.04), level_camera_pose(0.05, 0.05, 1.05, 0.0)), range_m=5.0)
    assert state_at(voxels, 1.05, 0.05, 1.05) == VoxelState.FREE
    assert state_at(voxels, 2.05, 0.05, 1.05) == VoxelState.OCCUPIED
    assert state_at(voxels, 2.15, 0.05, 1.05) == VoxelState.UNOBSERVED
    assert state_at(voxels, -0.15, 0.05, 1.05) == VoxelState.UNOBSERVED
    assert voxels.version == 1


def test_nothing_in_range_carves_to_the_range_and_no_return_carves_nothing() -> None:
    pose = level_camera_pose(0.05, 0.05, 1.05, 0.0)
    empty, glass = VoxelMap(VoxelConfig()), VoxelMap(VoxelConfig())
    empty.integrate_frame(frame_of(flat_wall(np.inf), pose), range_m=3.0)
    assert state_at(empty, 2.95, 0.05, 1.05) == VoxelState.FREE
    assert state_at(empty, 3.15, 0.05, 1.05) == VoxelState.UNOBSERVED
    assert not np.any(empty.states == VoxelState.OCCUPIED)
    glass.integrate_frame(frame_of(flat_wall(0.0), pose), range_m=3.0)
    assert not glass.states.any()
    assert not glass.missing().any()


def test_a_return_beyond_the_range_is_no_hit() -> None:
    voxels = VoxelMap(VoxelConfig())
    voxels.integrate_frame(frame_of(flat_wall(4.0), level_camera_pose(0, 0, 1, 0.3)), range_m=3.0)
    assert not np.any(voxels.states == VoxelState.OCCUPIED)


@pytest.mark.parametrize("wall_x", [2.0, 2.01, 1.99, 2.05])
def test_noise_on_a_wall_at_a_voxel_border_frees_nothing_behind_it(wall_x: float) -> None:
    rng = np.random.default_rng(0)
    camera = CAMERA
    voxels = VoxelMap(VoxelConfig())
    for _ in range(20):
        depth = flat_wall(wall_x - 0.05, camera) + rng.uniform(-0.02, 0.02, (camera.height, camera.width))
        voxels.integrate_frame(frame_of(depth, level_camera_pose(0.05, 0.05, 1.05, 0.0), camera), range_m=5.0)
    free = voxels.centres_m(np.argwhere(voxels.states == VoxelState.FREE))
    assert free[:, 0].max() < wall_x + 0.03
    hit = voxels.centres_m(np.argwhere(voxels.states == VoxelState.OCCUPIED))
    assert hit[:, 0].min() > wall_x - 0.08
    assert not voxels.missing()[voxels.index_of(np.array([[wall_x + 0.15, 0.05, 1.05]]))[0][0, 0] :].any()


def test_log_odds_are_clamped_and_a_moved_object_is_freed_again() -> None:
    config = VoxelConfig()
    voxels = VoxelMap(config)
    pose = level_camera_pose(0.05, 0.05, 1.05, 0.0)
    for _ in range(8):
        voxels.integrate_frame(frame_of(flat_wall(1.0), pose), range_m=5.0)
    assert voxels.log_odds.max() == np.float32(config.log_odds_limits[1])
    assert voxels.log_odds.min() == np.float32(config.log_odds_limits[0])
    for _ in range(9):
        voxels.integrate_frame(frame_of(flat_wall(2.0), pose), range_m=5.0)
    assert state_at(voxels, 1.05, 0.05, 1.05) == VoxelState.FREE


def test_a_region_is_a_fixed_box_and_growth_keeps_what_was_known() -> None:
    pose = level_camera_pose(0.05, 0.05, 1.05, 0.4)
    region = Box(lower_m=np.array([-0.5, -1.0, 0.0]), upper_m=np.array([1.2, 1.0, 2.0]))
    fixed, growing = VoxelMap(VoxelConfig(), region=region), VoxelMap(VoxelConfig())
    assert fixed.states.shape == (17, 20, 20)
    np.testing.assert_allclose(fixed.lower_m(), region.lower_m)
    growing.integrate_frame(frame_of(flat_wall(0.4), level_camera_pose(0.05, 0.05, 1.05, 3.0)), range_m=5.0)
    fixed.integrate_frame(frame_of(flat_wall(0.4), level_camera_pose(0.05, 0.05, 1.05, 3.0)), range_m=5.0)
    small = growing.states.shape
    for voxels in (fixed, growing):
        voxels.integrate_frame(frame_of(flat_wall(3.0), pose), range_m=5.0)
    assert fixed.states.shape == (17, 20, 20)
    assert np.all(np.array(growing.states.shape) >= small)
    assert growing.states.shape != small
    # Inside the region both know the same; rays were only cut at its border.
    shift = tuple(
        slice(int(a), int(a) + n)
        for a, n in zip(fixed.origin_index - growing.origin_index, fixed.states.shape, strict=True)
    )
    np.testing.assert_array_equal(growing.states[shift], fixed.states)
    np.testing.assert_array_equal(growing.log_odds[shift], fixed.log_odds)


def test_a_scan_carves_its_plane_only() -> None:
    voxels = VoxelMap(VoxelConfig())
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    ranges = np.where(np.abs(bearings) < 1.0, 1.5, np.inf).astype(np.float32)
    ranges[bearings > 3.0] = 0.0
    voxels.integrate_scan(
        Scan(origin_m=np.array([0.05, 0.05, 0.15]), bearings_rad=bearings, ranges_m=ranges, timestamp_s=0.0),
        range_m=3.0,
    )
    assert state_at(voxels, 1.55, 0.05, 0.15) == VoxelState.OCCUPIED
    assert state_at(voxels, 0.05, 2.95, 0.15) == VoxelState.FREE
    layers = np.unique(np.nonzero(voxels.states)[2]) + voxels.origin_index[2]
    assert layers.tolist() == [1]
    assert voxels.version == 1


# ---------------------------------------------------------------- against the oracle


@given(seed=st.integers(0, 10_000), stride=st.sampled_from([1, 3, 4]))
@settings(max_examples=8)
def test_integration_is_that_of_the_oracle_and_touches_nothing_else(seed: int, stride: int) -> None:
    rng = np.random.default_rng(seed)
    config = VoxelConfig(pixel_stride=stride)
    camera = CameraIntrinsics.centred(16, 12, 9.0)
    lower = rng.uniform(-0.6, -0.3, 3)
    voxels = VoxelMap(config, region=Box(lower_m=lower, upper_m=lower + rng.uniform(0.8, 1.6, 3)))
    # A map with a past: well-known free space, in which one more hit is not enough to block a view.
    voxels.states[:] = rng.choice(3, voxels.states.shape, p=[0.1, 0.85, 0.05])
    voxels.log_odds[:] = np.choose(voxels.states, [0.0, -2.0, 1.0])
    states, log_odds = voxels.states.copy(), voxels.log_odds.copy()
    attempts = voxels.attempts.copy()
    looks_in_vain = 0
    for _ in range(3):
        depth = rng.uniform(0.05, 2.0, (camera.height, camera.width)).astype(np.float32)
        depth[rng.random(depth.shape) < 0.1] = 0.0
        depth[rng.random(depth.shape) < 0.1] = np.inf
        pose = tilted_pose(rng, np.zeros(3))
        frame = frame_of(depth, pose, camera)
        voxels.integrate_frame(frame, range_m=1.5)
        ends, hits = naive.sampled_rays(frame, stride, 1.5)
        naive.update_by_rays(config, states, log_odds, voxels.origin_index, pose.translation, ends, hits)
        for cell in naive.looked_at_in_vain(config, states, voxels.origin_index, frame, 1.5):
            attempts[cell] += 1
            looks_in_vain += 1
    np.testing.assert_array_equal(voxels.states, states)
    np.testing.assert_array_equal(voxels.log_odds, log_odds)
    np.testing.assert_array_equal(voxels.attempts, attempts)
    np.testing.assert_array_equal(voxels.log_odds != 0, voxels.states != VoxelState.UNOBSERVED)
    event(f"looks in vain: {'some' if looks_in_vain else 'none'}")


@given(seed=st.integers(0, 10_000), share_free=st.floats(0.02, 0.3), cluster=st.integers(1, 12))
@settings(max_examples=25)
def test_missing_is_that_of_the_oracle(seed: int, share_free: float, cluster: int) -> None:
    rng = np.random.default_rng(seed)
    config = VoxelConfig(min_missing_cluster=cluster)
    region = Box(lower_m=np.zeros(3), upper_m=rng.uniform(0.3, 1.2, 3))
    voxels = VoxelMap(config, region=region)
    shape = voxels.states.shape
    voxels.states[:] = rng.choice([0, 1, 2], shape, p=[0.6 - share_free, share_free, 0.4])
    voxels.attempts[:] = rng.integers(0, 5, shape)
    np.testing.assert_array_equal(voxels.missing(), naive.missing(config, voxels.states, voxels.attempts))


# ---------------------------------------------------------------- looks in vain, missing


def blocked_view(depth: ndarray) -> tuple[VoxelMap, Frame, tuple[int, ...]]:
    """A free corridor along x with one unobserved voxel at (1.55, 0.05, 1.05) that `depth` may not reach."""
    voxels = VoxelMap(
        VoxelConfig(min_missing_cluster=1),
        region=Box(lower_m=np.array([0.0, -0.5, 0.5]), upper_m=np.array([3.0, 0.6, 1.6])),
    )
    voxels.states[:] = VoxelState.FREE
    voxels.log_odds[:] = -2.0
    cell = tuple(voxels.index_of(np.array([[1.55, 0.05, 1.05]]))[0][0])
    voxels.states[cell] = VoxelState.UNOBSERVED
    voxels.log_odds[cell] = 0.0
    return voxels, frame_of(depth, level_camera_pose(0.05, 0.05, 1.05, 0.0)), cell


def test_after_enough_looks_in_vain_a_voxel_no_longer_counts() -> None:
    voxels, frame, cell = blocked_view(flat_wall(1.2))
    for n in range(1, voxels.config.max_attempts + 1):
        assert voxels.missing()[cell]
        voxels.log_odds[:] = np.where(voxels.states, -2.0, 0.0)  # what ends the view stays below resolution
        voxels.integrate_frame(frame, range_m=5.0)
        assert voxels.attempts[cell] == n
    assert not voxels.missing()[cell]
    assert np.count_nonzero(voxels.attempts) == 1


def test_looks_that_never_happened_do_not_count() -> None:
    for depth in (flat_wall(0.0), flat_wall(2.5)):
        voxels, frame, cell = blocked_view(depth)
        # The voxel's ray falls between the sampled pixels.
        sparse = VoxelMap(VoxelConfig(min_missing_cluster=1, pixel_stride=90))
        sparse.restore(voxels.state())
        voxels = VoxelMap.restore({**voxels.state(), "config": sparse.config.model_dump()})
        voxels.integrate_frame(frame, range_m=5.0)
        assert voxels.states[cell] == VoxelState.UNOBSERVED
        assert not voxels.attempts.any()


def test_a_voxel_behind_something_known_was_not_looked_at() -> None:
    voxels, frame, cell = blocked_view(flat_wall(1.2))
    wall = voxels.index_of(np.array([[1.25, 0.05, 1.05]]))[0][0, 0]
    voxels.states[wall] = VoxelState.OCCUPIED
    voxels.log_odds[wall] = 3.0
    voxels.integrate_frame(frame, range_m=5.0)
    assert voxels.attempts[cell] == 0


def test_a_voxel_out_of_range_or_out_of_view_was_not_looked_at() -> None:
    voxels, frame, cell = blocked_view(flat_wall(1.2))
    voxels.integrate_frame(frame, range_m=1.4)
    turned = frame_of(flat_wall(0.3), level_camera_pose(0.05, 0.05, 1.05, 2.0))
    voxels.integrate_frame(turned, range_m=5.0)
    assert voxels.attempts[cell] == 0


def test_the_inside_of_a_wall_is_never_missing() -> None:
    voxels = VoxelMap(VoxelConfig(), region=Box(lower_m=np.zeros(3), upper_m=np.full(3, 2.0)))
    voxels.states[:] = VoxelState.FREE
    voxels.states[8:14] = VoxelState.OCCUPIED
    voxels.states[9:13] = VoxelState.UNOBSERVED
    assert not voxels.missing().any()


def test_missing_is_renewed_where_the_map_changed() -> None:
    rng = np.random.default_rng(5)
    voxels = VoxelMap(VoxelConfig())
    for k in range(12):
        pose = tilted_pose(rng, np.array([0.4 * k, 0.2 * k, 1.0]))
        depth = flat_wall(float(rng.uniform(0.5, 2.5)))
        version = voxels.version
        voxels.integrate_frame(frame_of(depth, pose), range_m=2.0)
        anew = VoxelMap.restore(voxels.state())
        assert voxels.changed_columns(version) is not None
        np.testing.assert_array_equal(voxels.missing(), anew.missing())
        np.testing.assert_array_equal(voxels.missing_in_columns(), anew.missing().sum(axis=2))
        assert voxels.n_missing == anew.missing().sum()
        assert voxels.n_observed == np.count_nonzero(voxels.states)
    assert voxels.changed_columns(voxels.version) is None


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), min_cluster=st.integers(1, 9), density=st.floats(0.3, 0.97))
def test_missing_is_renewed_as_if_counted_anew(seed: int, min_cluster: int, density: float) -> None:
    """After a change anywhere in a box, whatever clusters it joined, split or left too small."""
    rng = np.random.default_rng(seed)
    config = VoxelConfig(min_missing_cluster=min_cluster)
    states = np.where(rng.random((40, 36, 3)) < density, VoxelState.OCCUPIED, VoxelState.UNOBSERVED)
    states = np.where(rng.random(states.shape) < 0.3 * density, VoxelState.FREE, states).astype(np.uint8)
    attempts = rng.integers(0, 4, states.shape, dtype=np.uint8)
    missing, in_columns = np.zeros(states.shape, bool), np.zeros(states.shape[:2], np.int32)

    def renew(low: tuple[int, int], high: tuple[int, int]) -> int:
        return kernels.renew_missing(
            states, attempts, config.max_attempts, min_cluster, low, high, missing, in_columns
        )

    total = renew((0, 0), states.shape[:2])
    for _ in range(3):
        low = tuple(rng.integers(0, (35, 31)).tolist())
        high = tuple((low + rng.integers(1, 6, 2)).tolist())
        box = (slice(low[0], high[0]), slice(low[1], high[1]))
        states[box] = rng.integers(0, 3, states[box].shape)
        before = missing.copy()
        total += renew(low, high)
        expected = naive.missing(config, states, attempts)
        np.testing.assert_array_equal(missing, expected)
        np.testing.assert_array_equal(in_columns, expected.sum(axis=2))
        assert total == expected.sum()
        event(f"changed: {np.any(missing != before)}")


def test_observed_share_counts_the_voxels_of_the_box() -> None:
    voxels = VoxelMap(
        VoxelConfig(min_missing_cluster=1), region=Box(lower_m=np.zeros(3), upper_m=np.array([1.0, 1.0, 0.1]))
    )
    everywhere = Box(lower_m=np.full(3, -9.0), upper_m=np.full(3, 9.0))
    assert voxels.observed_share(everywhere) == 0.0
    voxels.note_change()
    voxels.states[:3] = VoxelState.FREE  # 30 of 100
    assert voxels.observed_share(everywhere) == pytest.approx(0.3)
    half = Box(lower_m=np.array([0.2, 0.0, 0.0]), upper_m=np.array([0.4, 0.5, 0.1]))
    assert voxels.observed_share(half) == pytest.approx(5 / 10)
    assert voxels.observed_share(Box(lower_m=np.full(3, 5.0), upper_m=np.full(3, 6.0))) == 0.0
    assert VoxelMap(VoxelConfig()).observed_share(everywhere) == 0.0


# ---------------------------------------------------------------- places, state, errors


def test_places_and_indices_are_inverse_to_each_other() -> None:
    voxels = VoxelMap(
        VoxelConfig(), region=Box(lower_m=np.array([-0.3, 0.2, 0]), upper_m=np.array([0.5, 0.9, 1]))
    )
    every = np.argwhere(np.ones(voxels.states.shape, bool))
    back, inside = voxels.index_of(voxels.centres_m(every))
    np.testing.assert_array_equal(back, every)
    assert inside.all()
    assert not voxels.index_of(np.array([[-0.31, 0.5, 0.5], [0.5, 0.5, 0.5]]))[1].any()


def test_state_is_all_that_is_needed_to_go_on() -> None:
    rng = np.random.default_rng(3)
    one = VoxelMap(VoxelConfig())
    frames = [frame_of(rng.uniform(0.5, 3, (192, 240)), tilted_pose(rng, np.zeros(3))) for _ in range(4)]
    for frame in frames[:2]:
        one.integrate_frame(frame, range_m=2.5)
    other = VoxelMap.restore(one.state())
    for frame in frames[2:]:
        one.integrate_frame(frame, range_m=2.5)
        other.integrate_frame(frame, range_m=2.5)
    for name in ("states", "log_odds", "attempts", "origin_index"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.version == other.version == 4


def test_broken_poses_do_not_allocate_the_universe() -> None:
    voxels = VoxelMap(VoxelConfig())
    voxels.integrate_frame(frame_of(flat_wall(2.0), level_camera_pose(0, 0, 1, 0)), range_m=5.0)
    with pytest.raises(MapError, match="check the poses"):
        voxels.integrate_frame(frame_of(flat_wall(2.0), level_camera_pose(1e6, 1e6, 1, 0)), range_m=5.0)
