"""A map that was built with drifting poses, once these are corrected, against the map of the true poses."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import MapError
from hgs_core.evaluation.surface import sample_surface, surface_metrics
from hgs_core.gaussians.gaussian_map import CENTRE
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.mapper import Mapper
from hgs_core.mapping.scan_log import ScanLog
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.voxel_map import VoxelState
from tests.gaussians.maps import gaussian_map
from tests.mapping.new_mapper import empty_mapper
from tests.scene.worlds import with_boxes

CAMERA = CameraIntrinsics.centred(160, 100, 90.0)
N_FRAMES = 15


@pytest.fixture(scope="module")
def caster() -> RayCaster:
    return RayCaster(with_boxes(((1.0, -0.5, 0.0), (1.6, 0.4, 1.2)), ((-2.4, 0.8, 0.0), (-1.6, 1.6, 1.8))))


def true_pose(k: int) -> SE3:
    """Once round, on a small circle; a keyframe each (24 degrees)."""
    yaw = 2 * np.pi * k / N_FRAMES
    return level_camera_pose(-0.4 + 0.3 * np.cos(yaw), 0.3 * np.sin(yaw), 1.0, yaw)


def drifted(k: int) -> SE3:
    """Off by up to 14 cm and 7 degrees, growing steadily."""
    share = k / (N_FRAMES - 1)
    turned = SE3.exp(np.array([0.12, -0.08, 0.02, 0.0, 0.0, np.radians(7.0)]) * share)
    return turned @ true_pose(k)


def scan_at(caster: RayCaster, true: SE3, believed: SE3, k: int) -> Scan:
    """Taken at the true place, told in the believed one's terms."""
    yaw = np.arctan2(true.rotation[1, 2], true.rotation[0, 2])
    off = np.arctan2(believed.rotation[1, 2], believed.rotation[0, 2]) - yaw
    bearings = yaw + np.arange(120) * (2 * np.pi / 120)
    directions = np.stack([np.cos(bearings), np.sin(bearings), np.zeros(120)], axis=1)
    origin = np.array([*true.translation[:2], 0.15])
    ranges = caster.cast(np.broadcast_to(origin, (120, 3)), directions)
    return Scan(
        origin_m=np.array([*believed.translation[:2], 0.15]),
        bearings_rad=bearings + off,
        ranges_m=np.where(ranges <= 5.0, ranges, np.inf).astype(np.float32),
        timestamp_s=0.4 * k,
    )


def mapped(caster: RayCaster, pose_of, folder: Path, **changes) -> Mapper:
    config = MappingConfig(iterations_per_s=2.5, keyframe_rotation_deg=20.0, **changes)
    mapper = empty_mapper(config, folder, correctable=True)
    rng = np.random.default_rng(0)
    for k in range(N_FRAMES):
        rgb, depth = caster.render(CAMERA, true_pose(k), 5.0)
        noisy = np.where(np.isfinite(depth), depth + rng.normal(0, 0.01, depth.shape), depth)
        mapper.integrate_scan(scan_at(caster, true_pose(k), pose_of(k), k))
        mapper.integrate(
            Frame(
                rgb=rgb,
                depth_m=noisy.astype(np.float32),
                intrinsics=CAMERA,
                T_world_camera=pose_of(k),
                timestamp_s=0.4 * k,
                sequence=k,
            )
        )
        mapper.optimise(interrupted=lambda: False)
    return mapper


def surface(mapper: Mapper, caster: RayCaster):
    samples = sample_surface(caster.mesh.vertices_m, caster.mesh.triangles, n_samples=5000)
    return surface_metrics(
        mapper.gaussians.centres_m,
        samples=samples,
        observable=np.ones(len(samples), bool),
        distance_to_surface=caster.distance_to_surface,
    )


def corrections() -> dict[int, SE3]:
    return {k: true_pose(k) for k in range(N_FRAMES)}


@pytest.mark.parametrize("primitive", ["isotropic", "disc"])
def test_a_corrected_map_comes_near_that_of_the_true_poses(
    caster: RayCaster, tmp_path: Path, primitive: str
) -> None:
    true = mapped(caster, true_pose, tmp_path / "true", primitive=primitive)
    off = mapped(caster, drifted, tmp_path / "off", primitive=primitive)
    assert len(off.keyframes) == N_FRAMES
    version, as_drifted = off.snapshot().version, surface(off, caster)
    report = off.correct_poses(corrections())
    assert off.snapshot().version > version
    assert report.keyframes == N_FRAMES
    assert report.gaussians == off.gaussians.size
    as_true, corrected = surface(true, caster), surface(off, caster)
    # What neighbouring frames averaged while they disagreed by a centimetre stays averaged.
    assert as_true.accuracy_cm < 0.3
    assert corrected.accuracy_cm < 0.9
    assert as_drifted.accuracy_cm > 4.0 * corrected.accuracy_cm
    assert corrected.completion_ratio > as_true.completion_ratio - 0.02
    # Voxels are built anew from keyframes and scans: they agree with those of the true poses, on the whole.
    states, theirs = (mapper.voxels.states for mapper in (off, true))
    common = tuple(slice(0, n) for n in np.minimum(states.shape, theirs.shape))
    shift = true.voxels.origin_index - off.voxels.origin_index
    assert (shift == 0).all()
    seen = (states[common] != VoxelState.UNOBSERVED) & (theirs[common] != VoxelState.UNOBSERVED)
    assert (states[common] == theirs[common])[seen].mean() > 0.95
    assert report.observed_after == off.voxels.n_observed
    assert 0.9 < off.voxels.n_observed / true.voxels.n_observed < 1.1


def test_the_view_of_a_keyframe_moves_with_it(caster: RayCaster, tmp_path: Path) -> None:
    """All keyframes by one motion: every view from its new pose is what it was from the old one."""
    mapper = mapped(caster, true_pose, tmp_path, primitive="disc")
    before = render(mapper.gaussians, CAMERA, true_pose(3))
    motion = SE3.exp(np.array([0.4, -0.3, 0.1, 0.02, -0.03, 0.8]))
    mapper.correct_poses({k: motion @ true_pose(k) for k in range(N_FRAMES)})
    after = render(mapper.gaussians, CAMERA, motion @ true_pose(3))
    # Rounding moves what lies at the border of a pixel.
    assert np.abs(after.colour - before.colour).mean() < 2e-3
    assert np.abs(after.depth_m - before.depth_m).mean() < 2e-3
    np.testing.assert_allclose(mapper.keyframes.last_pose.as_matrix(), (motion @ true_pose(14)).as_matrix())
    np.testing.assert_allclose(
        mapper.keyframes.load(3).T_world_camera.translation, (motion @ true_pose(3)).translation
    )
    # The map goes on: the next frame from there finds most of it known.
    rgb, depth = caster.render(CAMERA, true_pose(0), 5.0)
    frame = Frame(
        rgb=rgb,
        depth_m=depth,
        intrinsics=CAMERA,
        T_world_camera=motion @ true_pose(0),
        timestamp_s=7.0,
        sequence=99,
    )
    assert mapper.integrate(frame).inserted < 0.2 * len(np.flatnonzero(mapper.gaussians.anchor_keyframe == 0))


def test_only_the_gaussians_of_corrected_keyframes_move(caster: RayCaster, tmp_path: Path) -> None:
    mapper = mapped(caster, true_pose, tmp_path)
    before = mapper.gaussians.parameters[: mapper.gaussians.size].copy()
    anchors = mapper.gaussians.anchor_keyframe[: mapper.gaussians.size].copy()
    raised = SE3(rotation=np.eye(3), translation=np.array([0.0, 0.0, 0.5]))
    report = mapper.correct_poses({4: raised @ true_pose(4)})
    after = mapper.gaussians.parameters[: mapper.gaussians.size]
    assert report.gaussians == (anchors == 4).sum() > 0
    np.testing.assert_array_equal(after[anchors != 4], before[anchors != 4])
    np.testing.assert_allclose(
        after[anchors == 4, CENTRE] - before[anchors == 4, CENTRE],
        [[0, 0, 0.5]] * report.gaussians,
        atol=1e-5,
    )
    np.testing.assert_array_equal(after[:, 3:], before[:, 3:])


def test_what_is_known_of_a_centre_turns_with_it() -> None:
    """By a quarter turn about z, x becomes y: also for squares (moments, information)."""
    rows = np.zeros((4, 8), np.float32)
    rows[:, :3] = [1.0, 2.0, 3.0]
    gaussians = gaussian_map("disc", rows, np.random.default_rng(0))
    gaussians.anchor_keyframe[:4] = [0, 1, -1, 0]
    for name in ("adam_first_moment", "adam_second_moment", "information"):
        getattr(gaussians, name)[:4] = np.arange(1, 9)
    for name in ("normals", "normal_first_moment", "normal_second_moment"):
        getattr(gaussians, name)[:4] = [0.1, 0.2, 0.3]
    quarter = SE3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.pi / 2]))
    moved = gaussians.move_with_keyframes({0: quarter, 7: quarter})
    assert moved == 2
    assert gaussians.move_with_keyframes({}) == 0
    np.testing.assert_allclose(gaussians.centres_m, [[-2, 1, 3], [1, 2, 3], [1, 2, 3], [-2, 1, 3]], atol=1e-6)
    np.testing.assert_allclose(gaussians.adam_first_moment[0], [-2, 1, 3, 4, 5, 6, 7, 8], atol=1e-6)
    for name in ("adam_second_moment", "information"):
        np.testing.assert_allclose(getattr(gaussians, name)[0], [2, 1, 3, 4, 5, 6, 7, 8], atol=1e-6)
    np.testing.assert_allclose(gaussians.normals[:2], [[-0.2, 0.1, 0.3], [0.1, 0.2, 0.3]], atol=1e-6)
    np.testing.assert_allclose(gaussians.normal_second_moment[3], [0.2, 0.1, 0.3], atol=1e-6)


def test_a_correction_survives_a_checkpoint(caster: RayCaster, tmp_path: Path) -> None:
    """Correct, save, restore: and a further correction does the same to both."""
    mapper = mapped(caster, drifted, tmp_path)
    mapper.correct_poses({14: true_pose(14)})
    twin = empty_mapper(mapper.config, tmp_path, correctable=True)
    twin.restore(mapper.state(), keyframe_folder=tmp_path)
    for each in (mapper, twin):
        each.correct_poses(corrections())
    np.testing.assert_array_equal(twin.gaussians.centres_m, mapper.gaussians.centres_m)
    np.testing.assert_array_equal(twin.voxels.states, mapper.voxels.states)


def test_scans_are_kept_with_their_keyframes() -> None:
    log = ScanLog()
    for k, n in enumerate((4, 8, 4)):
        scan = Scan(
            origin_m=np.array([k, 0.0, 0.1]),
            bearings_rad=np.arange(n) * 0.1,
            ranges_m=np.arange(n, dtype=np.float32),
            timestamp_s=0.4 * k,
        )
        log.add(scan, anchor_keyframe=k // 2)
    assert len(log) == 3
    quarter = SE3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.pi / 2]))
    log.move({0: quarter})
    restored = ScanLog.restore(log.state())
    for each in (log, restored):
        assert [scan.timestamp_s for scan in each.of_keyframe(0)] == [0.0, 0.4]
        second = list(each.of_keyframe(0))[1]
        np.testing.assert_allclose(second.origin_m, [0.0, 1.0, 0.1], atol=1e-9)
        np.testing.assert_allclose(second.bearings_rad, np.arange(8) * 0.1 + np.pi / 2, atol=1e-6)
        np.testing.assert_allclose(next(each.of_keyframe(1)).origin_m, [2.0, 0.0, 0.1])
    assert len(ScanLog.restore(ScanLog().state())) == 0


def test_unknown_keyframes_and_inherited_maps_are_refused(caster: RayCaster, tmp_path: Path) -> None:
    mapper = mapped(caster, true_pose, tmp_path)
    with pytest.raises(MapError, match="no keyframe 15 to correct; there are 15, from 0"):
        mapper.correct_poses({15: true_pose(0), 2: true_pose(2)})
    mapper.keyframes._timestamps_s[0] = -1.0  # as those of another run are
    with pytest.raises(MapError, match="goes on from another run's"):
        mapper.correct_poses({2: true_pose(2)})
