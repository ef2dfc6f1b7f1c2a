import numpy as np
import pytest

from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.scene.procedural.mesh_builder import MeshBuilder, Surface
from hgs_core.scene.ray_caster import RayCaster
from tests.scene.worlds import CHECKER

PLAIN = Surface(name="plain", texture=CHECKER, size_m=(0.5, 0.5))
FITS = Surface(name="fits", texture=CHECKER, size_m=None)


def test_a_box_has_its_area_and_lies_between_its_corners():
    builder = MeshBuilder()
    builder.box((0, 0, 0), (1, 2, 3), PLAIN)
    mesh = builder.mesh()
    assert mesh.areas_m2.sum() == pytest.approx(22.0, rel=1e-5)
    np.testing.assert_allclose([mesh.vertices_m.min(0), mesh.vertices_m.max(0)], [[0, 0, 0], [1, 2, 3]])


def test_faces_left_out_are_missing():
    builder = MeshBuilder()
    builder.box((0, 0, 0), (1, 1, 1), PLAIN, without="zZ")
    assert builder.mesh().areas_m2.sum() == pytest.approx(4.0, rel=1e-5)


def test_a_round_box_stays_inside_its_corners():
    builder = MeshBuilder()
    builder.rounded_box((-1, -1, 0), (1, 1, 0.5), 0.1, PLAIN)
    mesh = builder.mesh()
    assert mesh.vertices_m.min() >= -1 - 1e-6
    assert mesh.vertices_m.max() <= 1 + 1e-6
    sharp = 2 * 4 + 4 * 2 * 0.5
    assert 0.85 * sharp < mesh.areas_m2.sum() < sharp


def test_a_cylinder_has_nearly_its_area():
    builder = MeshBuilder()
    builder.at(2, 0, 1, 0.3).cylinder(0.5, 0.0, 2.0, PLAIN, segments=64)
    expected = 2 * np.pi * 0.5 * 2 + 2 * np.pi * 0.25
    assert builder.mesh().areas_m2.sum() == pytest.approx(expected, rel=0.01)


def test_frames_turn_and_shift():
    builder = MeshBuilder()
    builder.at(1, 2, 3, np.pi / 2).box((0, 0, 0), (1, 0.1, 0.1), PLAIN)
    mesh = builder.mesh()
    np.testing.assert_allclose(mesh.vertices_m.min(0), [0.9, 2, 3], atol=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.max(0), [1.0, 3, 3.1], atol=1e-6)


@pytest.mark.parametrize(
    ("x", "y", "yaw"), [(-2.0, 0.5, 0.0), (3.0, 0.5, np.pi), (0.5, -2.0, np.pi / 2), (0.5, 3.0, -np.pi / 2)]
)
def test_pictures_on_a_box_read_the_same_from_all_four_sides(x, y, yaw):
    builder = MeshBuilder()
    builder.box((0, 0, 0), (1, 1, 1), FITS)
    rgb, _ = RayCaster(builder.mesh()).render(
        CameraIntrinsics.centred(40, 40, 60.0), level_camera_pose(x, y, 0.5, yaw)
    )
    top_left, top_right = rgb[12, 12].astype(int), rgb[12, 28].astype(int)
    low_left, low_right = rgb[28, 12].astype(int), rgb[28, 28].astype(int)
    assert np.argmax(top_left) == 0
    assert np.argmax(top_right) == 2
    assert np.argmax(low_left) == 1
    assert low_right[0] > 150
    assert low_right[1] > 150


def test_grain_runs_along_the_longer_side():
    grained = Surface(name="grained", texture=CHECKER, size_m=(1.0, 1.0), grain=True)
    builder = MeshBuilder()
    builder.quad([(0, 0, 0), (0.1, 0, 0), (0.1, 0, 2), (0, 0, 2)], grained)
    mesh = builder.mesh()
    spread = np.ptp(mesh.uv.reshape(-1, 2), axis=0)
    np.testing.assert_allclose(spread, [2.0, 0.1], atol=1e-6)
