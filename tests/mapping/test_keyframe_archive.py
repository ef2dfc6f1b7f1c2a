"""A finished run's keyframes: what the mapper learnt from, and the whole frames behind it."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray
from scipy.ndimage import gaussian_filter

from hgs_core.errors import MapError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import DepthFusionConfig
from hgs_core.mapping.depth_filter import training_image
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.keyframes import KeyframeStore
from hgs_core.sensing.frame import Frame

CAMERA = CameraIntrinsics(width=97, height=64, fx=60.0, fy=58.0, cx=50.0, cy=31.0, low_pass_px2=0.25)


def frame(number: int) -> Frame:
    """A smooth picture of two walls, one before the other, from a pose of its own."""
    rng = np.random.default_rng(number)
    depth = np.full((CAMERA.height, CAMERA.width), 2.0, np.float32)
    depth[:, 40:] = 4.0
    depth[:6], depth[6:10] = np.inf, 0.0
    smooth = gaussian_filter(rng.random((CAMERA.height, CAMERA.width, 3)), (4, 4, 0))
    spread = (smooth - smooth.min()) / np.ptp(smooth)
    return Frame(
        rgb=(255 * spread).astype(np.uint8),
        depth_m=depth,
        intrinsics=CAMERA,
        T_world_camera=SE3.exp(rng.uniform(-1.0, 1.0, 6)),
        timestamp_s=0.4 * number,
        sequence=number,
    )


@pytest.fixture
def stored(tmp_path: Path) -> tuple[Path, KeyframeStore]:
    """A run's folder with three keyframes."""
    store = KeyframeStore(tmp_path / "keyframes", range_m=5.0)
    for number in range(3):
        store.add(training_image(frame(number), DepthFusionConfig()), frame(number))
    store.write_transforms(tmp_path / "transforms.json")
    return tmp_path, store


def test_poses_and_times_are_those_that_were_stored(stored: tuple[Path, KeyframeStore]) -> None:
    folder, store = stored
    archive = KeyframeArchive.open(folder)
    assert len(archive) == 3
    assert archive.intrinsics == CAMERA
    np.testing.assert_allclose(archive.poses.as_matrix(), store.poses.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(archive.timestamps_s, [0.0, 0.4, 0.8])


def test_the_halved_image_is_what_the_mapper_learns_from(stored: tuple[Path, KeyframeStore]) -> None:
    folder, store = stored
    archive = KeyframeArchive.open(folder)
    for index in range(3):
        online, kept = store.load(index), archive.load_halved(index)
        assert kept.intrinsics == online.intrinsics
        np.testing.assert_array_equal(kept.depth_m, online.depth_m)
        assert np.abs(kept.rgb.astype(int) - online.rgb).mean() < 1
        assert np.abs(kept.rgb.astype(int) - online.rgb).max() <= 6


def test_the_full_image_has_the_frames_colour_and_no_depth_between_two_walls(
    stored: tuple[Path, KeyframeStore],
) -> None:
    image = KeyframeArchive.open(stored[0]).load(1)
    assert image.intrinsics == CAMERA
    assert np.abs(image.rgb.astype(int) - frame(1).rgb).mean() < 1
    assert np.abs(image.rgb.astype(int) - frame(1).rgb).max() <= 6
    measured = image.depth_m[image.measured]
    assert np.all((np.abs(measured - 2.0) < 1e-3) | (np.abs(measured - 4.0) < 1e-3))
    # The width is odd: nothing was kept of its last column. All else is the frame's, but the halved edge.
    np.testing.assert_array_equal(image.depth_m[:, -1], 0.0)
    np.testing.assert_allclose(image.depth_m[10:, :96], frame(1).depth_m[10:, :96], atol=1e-3)
    np.testing.assert_array_equal(image.depth_m[:6, :96], np.inf)


def test_points_of_both_resolutions_lie_on_one_surface(stored: tuple[Path, KeyframeStore]) -> None:
    archive = KeyframeArchive.open(stored[0])
    full, halved = archive.load(0), archive.load_halved(0)
    rays_full = full.intrinsics.rays()[:64, :96].reshape(32, 2, 48, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(rays_full, halved.intrinsics.rays(), atol=1e-12)


def test_transforms_are_in_nerfstudios_convention(stored: tuple[Path, KeyframeStore]) -> None:
    """The documented one: camera to world, camera looks along its own -z with y up; images relative."""
    folder, _ = stored
    content = json.loads((folder / "transforms.json").read_text())
    assert content["camera_model"] == "OPENCV"
    assert (content["w"], content["h"]) == (97, 64)
    assert (content["fl_x"], content["fl_y"], content["cx"], content["cy"]) == (60.0, 58.0, 50.0, 31.0)
    assert content["depth_unit_scale_factor"] == 1e-4
    for number, entry in enumerate(content["frames"]):
        matrix, pose = np.array(entry["transform_matrix"]), frame(number).T_world_camera
        forward, up = apply(matrix, (0, 0, -1)), apply(matrix, (0, 1, 0))
        np.testing.assert_allclose(forward, pose.apply(np.array([0.0, 0.0, 1.0])), atol=1e-12)
        np.testing.assert_allclose(up, pose.apply(np.array([0.0, -1.0, 0.0])), atol=1e-12)
        assert (folder / entry["file_path"]).is_file()
        assert (folder / entry["depth_file_path"]).is_file()


def apply(matrix: ndarray, point: tuple[int, int, int]) -> ndarray:
    return (matrix @ np.array([*point, 1.0]))[:3]


def test_what_is_missing_or_damaged_is_named(stored: tuple[Path, KeyframeStore], tmp_path: Path) -> None:
    folder, _ = stored
    archive = KeyframeArchive.open(folder)
    (folder / "keyframes" / "000002.jpg").unlink()
    with pytest.raises(MapError, match=r"000002\.jpg"):
        archive.load(2)
    (folder / "keyframes" / "000001_depth.png").write_bytes(b"")
    with pytest.raises(MapError, match=r"000001_depth\.png"):
        archive.load_halved(1)
    for content in ("{", "{}", '{"frames": []}', "[]"):
        (folder / "transforms.json").write_text(content)
        with pytest.raises(MapError, match=r"transforms\.json"):
            KeyframeArchive.open(folder)
    with pytest.raises(MapError, match="cannot read"):
        KeyframeArchive.open(tmp_path / "elsewhere")


def test_nothing_stored_is_nothing_to_describe(tmp_path: Path) -> None:
    store = KeyframeStore(tmp_path / "keyframes", range_m=5.0)
    with pytest.raises(MapError, match="no keyframe"):
        store.write_transforms(tmp_path / "transforms.json")
    assert not (tmp_path / "transforms.json").exists()
