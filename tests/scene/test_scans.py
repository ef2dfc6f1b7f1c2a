"""Scans open from the folders that their owners' downloads leave, and say what is wrong where they cannot."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from hgs_core.config import plugins
from hgs_core.errors import ConfigError, SceneError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.scene import registry
from hgs_core.scene.mesh_file import read_mesh_file
from hgs_core.scene.options import SceneOptions
from hgs_core.scene.placement import placed
from hgs_core.scene.registry import find_source, scene_sources, source_of
from hgs_core.scene.scene import Scene, open_scene
from tests.scene.scans import (
    HASH,
    WALLS,
    habitat_matterport3d,
    hm3d,
    matterport3d,
    replica,
    write_glb,
    write_obj,
    write_quad_ply,
)
from tests.scene.worlds import with_boxes

BLOCK = ((0.5, 0.5, 0.0), (1.5, 1.2, 0.8))


def assert_is_the_coloured_room(scene: Scene) -> None:
    """Size, floor and the hue of each wall, looked at from the middle."""
    np.testing.assert_allclose(scene.bounds.size_m, [5, 4, 2.5], atol=5e-3)
    assert scene.bounds.lower_m[2] == pytest.approx(0.0, abs=5e-3)
    for yaw, wall in ((0.0, "east"), (np.pi / 2, "north"), (np.pi, "west"), (-np.pi / 2, "south")):
        camera, pose = CameraIntrinsics.centred(8, 6, 20.0), level_camera_pose(2.5, 2.0, 1.2, yaw)
        rgb, _ = scene.caster.render(camera, pose)
        seen = rgb.mean(axis=(0, 1)) / rgb.mean(axis=(0, 1)).max()
        np.testing.assert_allclose(seen, np.array(WALLS[wall][1]) / max(WALLS[wall][1]), atol=0.04)


def assert_is_the_room_with_a_block(scene: Scene) -> None:
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=5e-3)
    down = scene.caster.cast(np.array([1.0, 0.8, 2.0]), np.array([0.0, 0.0, -1.0]))
    assert down == pytest.approx(1.2, abs=1e-3)


def test_a_matterport3d_scan_opens_from_its_folder(tmp_path: Path) -> None:
    scene = open_scene(matterport3d(tmp_path))
    assert scene.name == "17DRP5sb8fy"
    assert scene.notices == (f"Matterport3D scan, z up, metres: {HASH}.obj",)
    assert_is_the_coloured_room(scene)


def test_a_matterport3d_scan_opens_where_its_zip_was_unpacked_in_place(tmp_path: Path) -> None:
    folder = matterport3d(tmp_path)
    inner = folder / folder.name
    inner.mkdir()
    shutil.move(folder / "matterport_mesh", inner / "matterport_mesh")
    (folder / "matterport_mesh.zip").write_bytes(b"PK")
    assert_is_the_coloured_room(open_scene(folder))


def test_a_matterport3d_scan_that_is_packed_is_to_be_unpacked(tmp_path: Path) -> None:
    folder = matterport3d(tmp_path)
    shutil.rmtree(folder / "matterport_mesh")
    (folder / "matterport_mesh.zip").write_bytes(b"PK")
    with pytest.raises(SceneError, match=r"HASH\.obj.*unpack matterport_mesh\.zip"):
        open_scene(folder)


@pytest.mark.parametrize("meshes", [0, 2])
def test_a_matterport3d_scan_without_its_one_mesh_is_refused(tmp_path: Path, meshes: int) -> None:
    folder = matterport3d(tmp_path)
    if meshes:
        write_obj(folder / "matterport_mesh" / "another" / "another.obj")
    else:
        (folder / "matterport_mesh" / HASH / f"{HASH}.obj").unlink()
    with pytest.raises(SceneError, match=r"several meshes.*another" if meshes else "download it"):
        open_scene(folder)


def test_a_missing_texture_of_a_scan_is_stated(tmp_path: Path) -> None:
    folder = matterport3d(tmp_path)
    (folder / "matterport_mesh" / HASH / f"{HASH}_003.jpg").unlink()
    notices = open_scene(folder).notices
    assert any(f"{HASH}_003.jpg is missing" in notice for notice in notices)


@pytest.mark.parametrize("part", ["", "2t7WUuJeko7.glb"])
def test_habitats_matterport3d_is_z_up_by_folder_and_by_file(tmp_path: Path, part: str) -> None:
    scene = open_scene(habitat_matterport3d(tmp_path, with_boxes(BLOCK), basis=False) / part)
    assert scene.name == "2t7WUuJeko7"
    assert_is_the_room_with_a_block(scene)


@pytest.mark.parametrize("layout", ["mp3d", "hm3d", "plain"])
def test_basis_textures_are_refused_with_the_remedy(tmp_path: Path, layout: str) -> None:
    mesh = with_boxes(BLOCK)
    if layout == "mp3d":
        path = habitat_matterport3d(tmp_path, mesh, basis=True)
    elif layout == "hm3d":
        path = hm3d(tmp_path, mesh, forms=("basis.glb", "semantic.glb"))
    else:
        path = tmp_path / "flat.glb"
        write_glb(path, mesh, z_up=False, basis=True)
    with pytest.raises(SceneError, match=r"Basis format, for which there is no reader.*hm3d-\*-glb"):
        open_scene(path)


@pytest.mark.parametrize("forms", [("glb", "basis.glb", "semantic.glb"), ("glb", "obj")])
def test_an_hm3d_scan_opens_with_its_plain_glb(tmp_path: Path, forms: tuple[str, ...]) -> None:
    scene = open_scene(hm3d(tmp_path, with_boxes(BLOCK), forms=forms))
    assert scene.name == "00800-TEEsavR23oF"
    assert scene.notices == ("HM3D scan, z up, metres: TEEsavR23oF.glb",)
    assert_is_the_room_with_a_block(scene)


def test_an_hm3d_scan_opens_with_its_obj(tmp_path: Path) -> None:
    assert_is_the_coloured_room(open_scene(hm3d(tmp_path, with_boxes(BLOCK), forms=("basis.glb", "obj"))))


def test_hm3d_files_that_cannot_serve_say_why(tmp_path: Path) -> None:
    folder = hm3d(tmp_path, with_boxes(BLOCK), forms=("glb", "semantic.glb"))
    with pytest.raises(SceneError, match=r"object labels.*TEEsavR23oF\.glb"):
        open_scene(folder / "TEEsavR23oF.semantic.glb")
    (folder / "TEEsavR23oF.glb").unlink()
    with pytest.raises(SceneError, match=r"expected TEEsavR23oF\.glb .* found TEEsavR23oF\.semantic\.glb"):
        open_scene(folder)


def test_a_scan_on_its_side_is_doubted(tmp_path: Path) -> None:
    folder = tmp_path / "00801-HaxA7YrQdEC"
    write_glb(folder / "HaxA7YrQdEC.glb", with_boxes(((-3.0, -2.0, 1.2), (3.0, 2.0, 1.3))), z_up=False)
    raw = source_of(str(folder)).read(str(folder))
    scene = open_scene(folder, SceneOptions(up_axis="y"))
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=5e-3)
    _, notices = placed(raw.mesh, scale=1.0, up_axis=raw.known.up_axis)
    assert any("most of the surface faces y" in notice for notice in notices)


@pytest.mark.parametrize("part", ["", "mesh.ply"])
def test_a_replica_scene_opens_by_folder_and_by_file(tmp_path: Path, part: str) -> None:
    scene = open_scene(replica(tmp_path) / part)
    assert scene.name == "apartment_0"
    assert len(scene.mesh.triangles) == 2 * (2 * 20 * 16 + 2 * 20 * 10 + 2 * 16 * 10)
    assert any("tiles in textures/ are not read" in notice for notice in scene.notices)
    assert_is_the_coloured_room(scene)


def test_a_replica_scene_without_mesh_or_colours_is_refused(tmp_path: Path) -> None:
    folder = replica(tmp_path, colours=False)
    with pytest.raises(SceneError, match="no colours of vertices"):
        open_scene(folder)
    (folder / "mesh.ply").unlink()
    with pytest.raises(SceneError, match=r"no mesh\.ply of Replica, only .*semantic\.json.*unpack"):
        open_scene(folder)


def test_a_ply_of_mixed_polygons_is_cut_into_triangles(tmp_path: Path) -> None:
    write_quad_ply(tmp_path / "quads.ply")
    write_quad_ply(tmp_path / "mixed.ply", mixed=True)
    quads, _ = read_mesh_file(tmp_path / "quads.ply")
    mixed, _ = read_mesh_file(tmp_path / "mixed.ply")
    assert len(mixed.triangles) == len(quads.triangles)
    assert mixed.areas_m2.sum() == pytest.approx(quads.areas_m2.sum(), rel=1e-6)
    assert_is_the_coloured_room(open_scene(tmp_path / "mixed.ply"))


@pytest.mark.parametrize(("kept", "words"), [(-7, "ends within"), (None, "outside 0")])
def test_a_broken_ply_of_mixed_polygons_is_refused(tmp_path: Path, kept: int | None, words: str) -> None:
    path = tmp_path / "mixed.ply"
    write_quad_ply(path, mixed=True)
    content = path.read_bytes()
    path.write_bytes(content[:kept] if kept else content[:-4] + b"\xff\xff\xff\x0f")
    with pytest.raises(SceneError, match=words):
        open_scene(path)


def test_what_no_source_claims_is_described(tmp_path: Path) -> None:
    scans = matterport3d(tmp_path).parent
    with pytest.raises(SceneError, match=r"is a folder of scenes.*17DRP5sb8fy"):
        open_scene(scans)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "room.usd").write_text("")
    with pytest.raises(SceneError, match=r"it holds room\.usd\. What can be opened: .*matterport3d.*replica"):
        open_scene(tmp_path / "other")
    with pytest.raises(SceneError, match=r"no scene file, folder or name 'hose'.*house:SEED"):
        open_scene("hose")


def test_every_layout_is_claimed_by_its_source_alone(tmp_path: Path) -> None:
    mesh = with_boxes(BLOCK)
    layouts = {
        "matterport3d": [matterport3d(tmp_path), habitat_matterport3d(tmp_path, mesh, basis=False)],
        "hm3d": [hm3d(tmp_path, mesh, forms=("glb",))],
        "replica": [replica(tmp_path)],
        "built-in": [Path("house"), Path("house:7")],
    }
    sources = scene_sources()
    for name, paths in layouts.items():
        for path in paths:
            assert find_source(str(path)) is sources[name]


def test_a_scene_that_two_sources_claim_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    real = registry.scene_sources()
    monkeypatch.setattr(registry, "scene_sources", lambda: {**real, "again": real["built-in"]})
    with pytest.raises(ConfigError, match=r"'house' is claimed by several sources: built-in, again"):
        registry.source_of("house")


def test_something_else_than_a_source_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "load_plugin", lambda *_, **__: plugins)
    with pytest.raises(ConfigError, match="registered as a module, not a SceneSource"):
        registry.scene_sources()
