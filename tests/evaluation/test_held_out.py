"""Held-out views, on a room whose true look is known."""

import numpy as np
import pytest

from hgs_core.errors import MapError
from hgs_core.evaluation import held_out as held_out_module
from hgs_core.evaluation.held_out import held_out_poses, image_metrics
from hgs_core.evaluation.training_views import seen_in_training
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.scene.ray_caster import RayCaster

CAMERA = CameraIntrinsics.centred(96, 56, 48.0)


def batch(*poses: SE3) -> SE3:
    return SE3(
        rotation=np.stack([pose.rotation for pose in poses]).reshape(-1, 3, 3),
        translation=np.stack([pose.translation for pose in poses]).reshape(-1, 3),
    )


NO_POSES = SE3(rotation=np.zeros((0, 3, 3)), translation=np.zeros((0, 3)))


def test_poses_repeat_and_stand_on_the_grid() -> None:
    positions = np.array([[0.5, 0.5], [1.0, 0.5], [1.0, 2.0]])
    poses = held_out_poses(positions, camera_height_m=1.0)
    again = held_out_poses(positions, camera_height_m=1.0)
    np.testing.assert_array_equal(poses.as_matrix(), again.as_matrix())
    assert poses.translation.shape == (40, 3)
    assert {tuple(xy) for xy in poses.translation[:, :2]} == {tuple(xy) for xy in positions}
    np.testing.assert_array_equal(poses.translation[:, 2], 1.0)
    np.testing.assert_allclose(poses.rotation[:, 2, 2], 0.0, atol=1e-12)  # level: looks along the floor


def test_seen_in_training_equals_a_naive_loop(divided_room: RayCaster) -> None:
    rng = np.random.default_rng(0)
    frames = [
        level_camera_pose(*rng.uniform([0.3, 0.3], [2.6, 2.7]), 1.0, rng.uniform(-3, 3)) for _ in range(6)
    ]
    points, _ = divided_room.mesh.sample_surface(2000, rng)
    points = points.astype(np.float32)
    naive = np.zeros(len(points), bool)
    for frame in frames:
        in_camera = frame.inverse().apply(points)
        inside = CAMERA.project(in_camera)[1] & (in_camera[:, 2] <= 2.0)
        naive |= inside & divided_room.visible(frame.translation, points)
    seen = seen_in_training(
        divided_room, points, training_poses=batch(*frames), intrinsics=CAMERA, range_m=2.0
    )
    assert 0.1 < naive.mean() < 0.6
    np.testing.assert_array_equal(seen, naive)


def test_no_frames_and_no_points_see_nothing(empty_room: RayCaster) -> None:
    points = np.zeros((3, 3), np.float32)
    kwargs = {"intrinsics": CAMERA, "range_m": 5.0}
    assert not seen_in_training(empty_room, points, training_poses=NO_POSES, **kwargs).any()
    one = batch(level_camera_pose(1, 1, 1, 0))
    assert len(seen_in_training(empty_room, points[:0], training_poses=one, **kwargs)) == 0


def with_fake_render(
    monkeypatch: pytest.MonkeyPatch, caster: RayCaster, colour_error: float, depth_error_m: float
) -> None:
    """A map whose picture is the truth plus constant errors."""

    def fake(_: GaussianMap, intrinsics: CameraIntrinsics, pose: SE3) -> RenderedView:
        rgb, depth = caster.render(intrinsics, pose)
        return RenderedView(
            colour_sum=rgb.astype(np.float32) / 255 + np.float32(colour_error),
            depth_sum=depth + np.float32(depth_error_m),
            silhouette=np.ones_like(depth),
        )

    monkeypatch.setattr(held_out_module, "render", fake)


def test_constant_errors_are_found(empty_room: RayCaster, monkeypatch: pytest.MonkeyPatch) -> None:
    """0.1 in colour is 20 dB, 3 cm in depth is 3 cm; a turn on the spot saw all that a view shows."""
    with_fake_render(monkeypatch, empty_room, -0.1, 0.03)
    turn = batch(*(level_camera_pose(2, 1.5, 1, yaw) for yaw in np.radians(np.arange(0, 360, 30))))
    poses = batch(level_camera_pose(2, 1.5, 1, 0.3), level_camera_pose(2, 1.5, 1, 2.3))
    metrics = image_metrics(
        empty_room, GaussianMap(), poses=poses, training_poses=turn, intrinsics=CAMERA, range_m=5.0
    )
    assert metrics.n_views == 2
    assert metrics.psnr_db == pytest.approx(20.0, abs=0.01)
    assert metrics.psnr_db_unmasked == pytest.approx(20.0, abs=0.01)
    assert metrics.depth_l1_cm == pytest.approx(3.0, abs=0.01)
    assert metrics.median_depth_error_cm == pytest.approx(3.0, abs=0.01)
    assert 0.9 < metrics.ssim < 1.0
    assert metrics.observed_mask_share > 0.97


def test_pixels_that_no_frame_saw_are_masked(
    divided_room: RayCaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One view beside the only training frame, one in the other room: half of all pixels, figures of one."""
    with_fake_render(monkeypatch, divided_room, -0.1, 0.0)
    left, right = level_camera_pose(1, 1.5, 1, np.pi), level_camera_pose(5, 1.5, 1, 0.0)
    metrics = image_metrics(
        divided_room,
        GaussianMap(),
        poses=batch(left, right),
        training_poses=batch(left),
        intrinsics=CAMERA,
        range_m=5.0,
    )
    assert metrics.observed_mask_share == pytest.approx(0.5, abs=0.02)
    assert metrics.psnr_db == pytest.approx(20.0, abs=0.01)


def test_without_training_frames_masked_figures_are_not_numbers(
    empty_room: RayCaster, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_fake_render(monkeypatch, empty_room, -0.1, 0.0)
    metrics = image_metrics(
        empty_room,
        GaussianMap(),
        poses=batch(level_camera_pose(2, 1.5, 1, 0)),
        training_poses=NO_POSES,
        intrinsics=CAMERA,
        range_m=5.0,
    )
    assert np.isnan([metrics.psnr_db, metrics.ssim, metrics.depth_l1_cm, metrics.median_depth_error_cm]).all()
    assert metrics.psnr_db_unmasked == pytest.approx(20.0, abs=0.01)
    assert metrics.observed_mask_share == 0


def test_no_poses_is_an_error(empty_room: RayCaster) -> None:
    with pytest.raises(MapError, match="at least one"):
        image_metrics(
            empty_room,
            GaussianMap(),
            poses=NO_POSES,
            training_poses=NO_POSES,
            intrinsics=CAMERA,
            range_m=5.0,
        )
