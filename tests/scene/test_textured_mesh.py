import numpy as np
import pytest

from hgs_core.errors import SceneError
from hgs_core.scene.textured_mesh import TexturedMesh, concatenated
from tests.scene.worlds import box, quad, room


def test_the_area_of_a_room_is_that_of_its_six_faces():
    mesh = room((-3.0, 3.0), (-2.0, 2.0), 2.5)
    assert mesh.areas_m2.sum() == pytest.approx(2 * (6 * 4 + 6 * 2.5 + 4 * 2.5), rel=1e-6)


def test_normals_are_unit_vectors_across_their_face():
    mesh = quad([(0, 0, 1), (2, 0, 1), (2, 3, 1), (0, 3, 1)])
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1], [0, 0, 1]])


def test_samples_lie_on_the_surface_and_are_spread_by_area():
    mesh = concatenated([box((0, 0, 0), (1, 1, 1)), box((5, 0, 0), (8, 3, 3))])
    points, triangle = mesh.sample_surface(20000, np.random.default_rng(0))
    corners = mesh.corners_m[triangle].astype(float)
    off_plane = np.einsum("nd,nd->n", points - corners[:, 0], mesh.normals[triangle])
    assert np.abs(off_plane).max() < 1e-5
    assert np.mean(points[:, 0] < 2) == pytest.approx(6 / 60, abs=0.01)


def test_kept_drops_triangles_and_their_vertices_only():
    mesh = concatenated([box((0, 0, 0), (1, 1, 1)), box((5, 0, 0), (6, 1, 1))])
    kept = mesh.kept(mesh.corners_m[:, :, 0].max(axis=1) < 3)
    assert len(kept.triangles) == 12
    assert kept.vertices_m[:, 0].max() == 1.0
    np.testing.assert_array_equal(kept.corners_m, mesh.corners_m[:12])
    np.testing.assert_array_equal(kept.uv, mesh.uv[:12])


def test_moved_scales_turns_and_shifts():
    mesh = quad([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    moved = mesh.moved(turn, np.array([0.0, 0.0, 5.0]), 2.0)
    np.testing.assert_allclose(moved.vertices_m[1], [0, 2, 5], atol=1e-6)


def test_indices_that_point_nowhere_are_refused():
    good = quad([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    with pytest.raises(SceneError, match="vertices outside"):
        TexturedMesh(
            vertices_m=good.vertices_m,
            triangles=good.triangles + 2,
            uv=good.uv,
            material_index=good.material_index,
            materials=good.materials,
        )
    with pytest.raises(SceneError, match="materials outside"):
        TexturedMesh(
            vertices_m=good.vertices_m,
            triangles=good.triangles,
            uv=good.uv,
            material_index=good.material_index + 1,
            materials=good.materials,
        )
