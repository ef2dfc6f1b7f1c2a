"""The fused mesh lies on the surface that the depth shows, whatever the tiles; files keep it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from numpy import ndarray
from scipy.spatial import cKDTree

from hgs_core.errors import MapError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping import volume_fusion
from hgs_core.mapping.keyframes import TrainingImage
from hgs_core.mapping.mesh_file import read_mesh, write_mesh
from hgs_core.mapping.volume_fusion import MeshConfig, SurfaceMesh, fuse_mesh

CAMERA = CameraIntrinsics(width=100, height=80, fx=75.0, fy=75.0, cx=55.0, cy=35.0)
NORMAL = np.array([1.0, 0.35, 0.2]) / np.linalg.norm([1.0, 0.35, 0.2])
OFFSET_M = 1.8
RGB = (200, 100, 50)


class Images:
    """Training images in memory."""

    def __init__(self, images: Sequence[TrainingImage]) -> None:
        self._images = images

    def __len__(self) -> int:
        return len(self._images)

    def load_halved(self, index: int) -> TrainingImage:
        return self._images[index]


def slanted_wall(x_m: float, yaw_rad: float) -> TrainingImage:
    """The plane NORMAL . p = OFFSET_M, seen from (x, 0, 1): along a ray c + t d, t = (o - n.c) / n.d."""
    pose = level_camera_pose(x_m, 0.0, 1.0, yaw_rad)
    along = CAMERA.rays() @ pose.rotation.T @ NORMAL
    depth = (OFFSET_M - NORMAL @ pose.translation) / along
    return TrainingImage(
        rgb=np.full((CAMERA.height, CAMERA.width, 3), RGB, np.uint8),
        depth_m=np.where((depth > 0) & (depth < 5.0), depth, np.inf).astype(np.float32),
        intrinsics=CAMERA,
        T_world_camera=pose,
    )


def three_views() -> Images:
    return Images([slanted_wall(0.0, 0.0), slanted_wall(0.0, 0.3), slanted_wall(0.2, -0.3)])


def from_plane_m(mesh: SurfaceMesh) -> ndarray:
    return mesh.vertices_m.astype(float) @ NORMAL - OFFSET_M


def test_the_mesh_lies_on_the_surface_without_bias() -> None:
    """A pixel taken for its neighbour would shift the wall by 8 mm (2 m / 75 px x the slope's 0.3)."""
    mesh = fuse_mesh(three_views(), MeshConfig())
    assert len(mesh.vertices_m) > 5_000
    assert abs(from_plane_m(mesh).mean()) < 1e-3
    assert np.abs(from_plane_m(mesh)).mean() < 3e-3
    np.testing.assert_allclose(mesh.rgb, np.tile(RGB, (len(mesh.rgb), 1)), atol=1)


def test_triangles_face_whoever_saw_them() -> None:
    mesh = fuse_mesh(three_views(), MeshConfig())
    a, b, c = (mesh.vertices_m[mesh.triangles[:, k]].astype(float) for k in range(3))
    normals = np.cross(b - a, c - a)
    towards_camera = np.array([0.0, 0.0, 1.0]) - a
    facing = np.einsum("ij,ij->i", normals, towards_camera) > 0
    assert facing.mean() > 0.95


def test_tiles_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = fuse_mesh(three_views(), MeshConfig())
    monkeypatch.setattr(volume_fusion, "_TILE_BLOCKS", 3)
    heard: list[str] = []
    tiled = fuse_mesh(three_views(), MeshConfig(), progress=heard.append)
    assert len(heard) > 4
    assert len(tiled.triangles) == len(whole.triangles)
    assert len(tiled.vertices_m) == len(whole.vertices_m)
    assert farthest_apart_m(tiled.vertices_m, whole.vertices_m) < 1e-6
    # The same triangles, too: their centres are.
    assert farthest_apart_m(centres(tiled), centres(whole)) < 1e-6


def farthest_apart_m(a: ndarray, b: ndarray) -> float:
    """The largest distance of a point of one set to the nearest of the other."""
    return float(max(cKDTree(b).query(a)[0].max(), cKDTree(a).query(b)[0].max()))


def centres(mesh: SurfaceMesh) -> ndarray:
    return mesh.vertices_m[mesh.triangles].mean(axis=1)


def test_voxels_seen_too_rarely_make_no_surface() -> None:
    one = Images([slanted_wall(0.0, 0.0)])
    assert len(fuse_mesh(one, MeshConfig(min_observations=1)).triangles) > 1000
    assert len(fuse_mesh(one, MeshConfig(min_observations=2)).triangles) == 0


def test_without_depth_there_is_no_mesh() -> None:
    seen = slanted_wall(0.0, 0.0)
    blind = TrainingImage(
        rgb=seen.rgb,
        depth_m=np.full_like(seen.depth_m, np.inf),
        intrinsics=CAMERA,
        T_world_camera=seen.T_world_camera,
    )
    for images in (Images([]), Images([blind])):
        mesh = fuse_mesh(images, MeshConfig())
        assert mesh.vertices_m.shape == mesh.triangles.shape == mesh.rgb.shape == (0, 3)


def test_a_mesh_survives_its_file_and_an_independent_reader_sees_it(tmp_path: Path) -> None:
    mesh = fuse_mesh(three_views(), MeshConfig(voxel_size_m=0.05))
    path = tmp_path / "mesh.ply"
    write_mesh(mesh, path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["mesh.ply"]
    theirs = o3d.t.io.read_triangle_mesh(str(path))
    np.testing.assert_array_equal(theirs.vertex.positions.numpy(), mesh.vertices_m)
    np.testing.assert_allclose(theirs.vertex.colors.numpy() * 255.0, mesh.rgb, atol=1e-3)
    np.testing.assert_array_equal(theirs.triangle.indices.numpy(), mesh.triangles)
    ours = read_mesh(path)
    np.testing.assert_array_equal(ours.vertices_m, mesh.vertices_m)
    np.testing.assert_array_equal(ours.triangles, mesh.triangles)
    np.testing.assert_array_equal(ours.rgb, mesh.rgb)


def test_what_is_no_mesh_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="hgs mesh"):
        read_mesh(tmp_path / "mesh.ply")
    (tmp_path / "mesh.ply").write_text("ply\n")
    with pytest.raises(MapError, match=r"mesh\.ply"):
        read_mesh(tmp_path / "mesh.ply")
