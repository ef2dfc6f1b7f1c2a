"""Keyframes survive their trip to disk, and know which others show the same place."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import MapError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.keyframes import KeyframeStore, TrainingImage, halved_camera
from hgs_core.sensing.frame import Frame

FULL_CAMERA = CameraIntrinsics.centred(120, 80, 60.0)
CAMERA = halved_camera(FULL_CAMERA)


def add(store: KeyframeStore, image: TrainingImage, camera: CameraIntrinsics = FULL_CAMERA) -> int:
    frame = Frame(
        rgb=image.rgb.repeat(2, axis=0).repeat(2, axis=1),
        depth_m=image.depth_m.repeat(2, axis=0).repeat(2, axis=1),
        intrinsics=camera,
        T_world_camera=image.T_world_camera,
        timestamp_s=0.4 * len(store),
        sequence=len(store),
    )
    return store.add(image, frame)


def image_at(x_m: float, yaw_rad: float) -> TrainingImage:
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.5, 4.9, (40, 60)).astype(np.float32)
    depth[:3] = np.inf
    depth[3:6] = 0.0
    return TrainingImage(
        rgb=rng.integers(0, 256, (40, 60, 3)).astype(np.uint8),
        depth_m=depth,
        intrinsics=CAMERA,
        T_world_camera=level_camera_pose(x_m, 0, 1, yaw_rad),
    )


def test_round_trip(tmp_path: Path) -> None:
    store = KeyframeStore(tmp_path, range_m=5.0)
    image = image_at(0.5, 0.3)
    loaded = store.load(add(store, image))
    np.testing.assert_array_equal(loaded.rgb, image.rgb)
    np.testing.assert_allclose(loaded.depth_m, image.depth_m, atol=6e-5)
    np.testing.assert_allclose(loaded.T_world_camera.as_matrix(), image.T_world_camera.as_matrix())


def test_overlap_is_whole_with_itself_and_none_behind(tmp_path: Path) -> None:
    store = KeyframeStore(tmp_path, range_m=5.0)
    here = image_at(0.0, 0.0)
    add(store, here)
    add(store, image_at(0.0, np.pi))
    overlap = store.overlap(here, range_m=5.0)
    assert overlap[0] == 1.0
    assert overlap[1] == 0.0


def test_overlap_is_the_share_of_probes_in_view_wherever_the_keyframes_are(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    store = KeyframeStore(tmp_path, range_m=5.0)
    images = [
        image_at(x, yaw) for x, yaw in zip(rng.uniform(-25, 25, 60), rng.uniform(-3, 3, 60), strict=True)
    ]
    for image in images:
        add(store, image)
    probe = image_at(0.0, 0.4)
    together = store.overlap(probe, range_m=5.0)
    for k, image in enumerate(images):
        alone = KeyframeStore(tmp_path / f"{k}", range_m=5.0)
        add(alone, image)
        # Where it stands as well, nobody is too far to be looked at.
        add(alone, probe)
        assert together[k] == alone.overlap(probe, range_m=5.0)[0]
    assert 0 < np.count_nonzero(together) < 30


def test_state_is_enough_to_go_on(tmp_path: Path) -> None:
    store = KeyframeStore(tmp_path, range_m=5.0)
    for x in (0.0, 0.5, 1.0):
        add(store, image_at(x, 0.1))
    restored = KeyframeStore.restore(tmp_path, store.state())
    probe = image_at(0.2, 0.2)
    np.testing.assert_array_equal(restored.overlap(probe, range_m=5.0), store.overlap(probe, range_m=5.0))
    np.testing.assert_array_equal(restored.load(2).rgb, store.load(2).rgb)


def test_the_camera_of_a_halved_image_draws_splats_as_wide_as_the_full_one() -> None:
    odd = CameraIntrinsics(width=121, height=81, fx=60.0, fy=58.0, cx=61.0, cy=40.0, low_pass_px2=0.3)
    halved = halved_camera(odd)
    assert (halved.width, halved.height) == (60, 40)
    assert (halved.fx, halved.fy, halved.cx, halved.cy) == (30.0, 29.0, 30.5, 20.0)
    # sqrt(0.3) px of the full image are half as many of the halved one.
    assert np.sqrt(halved.low_pass_px2) == pytest.approx(np.sqrt(0.3) / 2)


def test_frames_of_another_camera_are_refused(tmp_path: Path) -> None:
    store = KeyframeStore(tmp_path, range_m=5.0)
    add(store, image_at(0.0, 0.0))
    with pytest.raises(MapError, match="one camera"):
        add(store, image_at(0.5, 0.0), CameraIntrinsics.centred(120, 80, 61.0))
    assert len(store) == 1
