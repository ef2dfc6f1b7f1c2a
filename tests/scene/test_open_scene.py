import json

import numpy as np
import pytest
import trimesh
from PIL import Image

from hgs_core.errors import SceneError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.scene.built_in import BUILT_IN_SCENES
from hgs_core.scene.options import SceneOptions, StartOptions
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.registry import scene_names
from hgs_core.scene.scene import open_scene
from tests.scene.worlds import CHECKER, quad, room, tessellated, textured, with_boxes, y_up

BLOCK = ((0.5, 0.5, 0.0), (1.5, 1.2, 0.8))


def notice(scene, *words):
    """The one notice that has all the words."""
    found = [n for n in scene.notices if all(word in n for word in words)]
    assert len(found) == 1, scene.notices
    return found[0]


def test_a_glb_is_y_up_and_opens_without_notices(tmp_path):
    y_up(textured(with_boxes(BLOCK))).export(tmp_path / "room.glb")
    scene = open_scene(tmp_path / "room.glb")
    assert scene.name == "room"
    assert scene.notices == ()
    np.testing.assert_allclose(scene.bounds.lower_m, [-3, -2, 0], atol=2e-3)
    np.testing.assert_allclose(scene.bounds.upper_m, [3, 2, 2.5], atol=2e-3)
    # The block is where it was: world = (x, -z, y).
    assert scene.caster.cast(np.array([1.0, 0.8, 2.0]), np.array([0.0, 0.0, -1.0])) == pytest.approx(
        1.2, abs=1e-4
    )


def test_textures_survive_the_file(tmp_path):
    original = with_boxes(BLOCK)
    y_up(textured(original)).export(tmp_path / "room.glb")
    pose, camera = level_camera_pose(-1.0, -1.0, 1.0, 0.7), CameraIntrinsics.centred(64, 48, 40.0)
    expected, _ = RayCaster(original).render(camera, pose)
    rgb, _ = open_scene(tmp_path / "room.glb").caster.render(camera, pose)
    assert np.mean(np.abs(rgb.astype(int) - expected)) < 1.0


def test_corners_of_an_obj_share_places_and_not_texture_coordinates(tmp_path):
    """As scanners write it: a place once, and a texture coordinate for each face that meets there."""
    original = with_boxes(BLOCK)
    places, corner = np.unique(original.corners_m.reshape(-1, 3), axis=0, return_inverse=True)
    assert len(places) == 16
    Image.fromarray(CHECKER).save(tmp_path / "checker.png")
    (tmp_path / "room.mtl").write_text("newmtl checker\nmap_Kd checker.png\n")
    lines = ["mtllib room.mtl", *(f"v {x} {y} {z}" for x, y, z in places)]
    lines += [f"vt {u} {v}" for u, v in original.uv.reshape(-1, 2)]
    lines += ["usemtl checker"]
    for k, (a, b, c) in enumerate(corner.reshape(-1, 3) + 1):
        lines.append(f"f {a}/{3 * k + 1} {b}/{3 * k + 2} {c}/{3 * k + 3}")
    (tmp_path / "room.obj").write_text("\n".join(lines) + "\n")
    pose, camera = level_camera_pose(-1.0, -1.0, 1.0, 0.7), CameraIntrinsics.centred(64, 48, 40.0)
    expected, _ = RayCaster(original).render(camera, pose)
    rgb, _ = open_scene(tmp_path / "room.obj", SceneOptions(up_axis="z")).caster.render(camera, pose)
    assert np.mean(np.abs(rgb.astype(int) - expected)) < 1.0


def test_node_transforms_are_applied(tmp_path):
    world = trimesh.Scene()
    world.add_geometry(
        y_up(textured(room())), transform=trimesh.transformations.translation_matrix([10.0, 0.0, 0.0])
    )
    world.export(tmp_path / "moved.glb")
    scene = open_scene(tmp_path / "moved.glb")
    assert scene.bounds.lower_m[0] == pytest.approx(7.0, abs=2e-3)


def test_the_floor_is_moved_to_zero_and_stated(tmp_path):
    raised = y_up(textured(room()))
    raised.apply_translation([0.0, 1.3, 0.0])
    raised.export(tmp_path / "raised.glb")
    scene = open_scene(tmp_path / "raised.glb")
    assert scene.bounds.lower_m[2] == pytest.approx(0.0, abs=2e-3)
    notice(scene, "floor found at z = 1.300")


def test_the_underside_of_a_floor_slab_is_not_the_floor(tmp_path):
    slab = with_boxes(((-3.0, -2.0, -0.3), (3.0, 2.0, -0.001)))
    y_up(textured(slab)).export(tmp_path / "slab.glb")
    scene = open_scene(tmp_path / "slab.glb")
    assert scene.bounds.lower_m[2] == pytest.approx(-0.3, abs=5e-3)


@pytest.mark.parametrize("factor", [1000.0, 100.0, 0.001])
def test_another_unit_is_repaired_and_stated(tmp_path, factor):
    mesh = y_up(textured(room()))
    mesh.apply_scale(factor)
    mesh.export(tmp_path / "unit.glb")
    scene = open_scene(tmp_path / "unit.glb")
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=3e-3)
    notice(scene, f"rescaled by {1 / factor:g}")


def test_a_scale_that_no_power_of_ten_repairs_is_an_error_until_given(tmp_path):
    mesh = y_up(textured(room()))
    mesh.apply_scale([60.0, 600.0, 60.0])
    mesh.export(tmp_path / "odd.glb")
    with pytest.raises(SceneError, match=r"no power of ten .* give scene.scale"):
        open_scene(tmp_path / "odd.glb")
    plain = y_up(textured(room()))
    plain.apply_scale(39.37)
    plain.export(tmp_path / "inches.glb")
    scene = open_scene(tmp_path / "inches.glb", SceneOptions(scale=0.0254))
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=5e-3)


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
@pytest.mark.parametrize("turned", [True, False])
def test_the_up_axis_of_obj_and_ply_is_found_and_stated(tmp_path, suffix, turned):
    mesh = tessellated(with_boxes(BLOCK))
    path = tmp_path / f"room{suffix}"
    (y_up(mesh) if turned else mesh).export(path)
    scene = open_scene(path)
    notice(scene, f"up axis taken to be {'y' if turned else 'z'}")
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=3e-3)
    assert scene.caster.cast(np.array([1.0, 0.8, 2.0]), np.array([0.0, 0.0, -1.0])) == pytest.approx(
        1.2, abs=1e-4
    )


def test_a_given_up_axis_is_taken(tmp_path):
    mesh = tessellated(with_boxes(BLOCK))
    mesh.vertices = np.asarray(mesh.vertices) * [1.0, -1.0, -1.0]
    mesh.export(tmp_path / "down.ply")
    scene = open_scene(tmp_path / "down.ply", SceneOptions(up_axis="-z"))
    assert scene.caster.cast(np.array([1.0, 0.8, 2.0]), np.array([0.0, 0.0, -1.0])) == pytest.approx(
        1.2, abs=1e-4
    )


def test_vertex_colours_of_a_ply_are_seen(tmp_path):
    mesh = tessellated(room())
    mesh.visual.vertex_colors = np.tile([200, 40, 60, 255], (len(mesh.vertices), 1))
    mesh.export(tmp_path / "red.ply")
    rgb, _ = open_scene(tmp_path / "red.ply").caster.render(
        CameraIntrinsics.centred(16, 12, 8.0), level_camera_pose(0.0, 0.0, 1.0, 0.0)
    )
    np.testing.assert_allclose(rgb / rgb[..., :1], np.broadcast_to([1, 0.2, 0.3], rgb.shape), atol=0.03)


def test_nan_vertices_are_dropped_and_stated(tmp_path):
    mesh = tessellated(room())
    vertices = np.array(mesh.vertices)
    vertices[5] = np.nan
    touched = int((np.asarray(mesh.faces) == 5).any(axis=1).sum())
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(tmp_path / "nan.ply")
    scene = open_scene(tmp_path / "nan.ply")
    notice(scene, f"dropped {touched} triangles", "NaN")
    assert np.isfinite(scene.mesh.vertices_m).all()


def test_far_outliers_are_dropped_and_stated(tmp_path):
    mesh = tessellated(room())
    vertices = np.array(mesh.vertices)
    vertices[7] = [0.0, 0.0, 343e3]
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(tmp_path / "far.ply")
    scene = open_scene(tmp_path / "far.ply")
    notice(scene, "dropped", "3.43e+05 units away")
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=3e-3)


def test_files_without_triangles_are_refused(tmp_path):
    trimesh.PointCloud(np.random.default_rng(0).random((50, 3))).export(tmp_path / "cloud.ply")
    with pytest.raises(SceneError, match="no triangles"):
        open_scene(tmp_path / "cloud.ply")
    mesh = tessellated(room())
    trimesh.Trimesh(np.full_like(mesh.vertices, np.nan), mesh.faces, process=False).export(
        tmp_path / "allnan.ply"
    )
    with pytest.raises(SceneError, match="no triangles with finite vertices"):
        open_scene(tmp_path / "allnan.ply")


@pytest.mark.parametrize(
    "name", ["absent.glb", "scene.usd", "broken.glb", "broken.gltf", "broken.obj", "broken.ply"]
)
def test_files_that_cannot_be_read_are_refused(tmp_path, name):
    if name.startswith("broken"):
        (tmp_path / name).write_bytes(b"not a mesh at all\n")
    with pytest.raises(SceneError, match=r"no scene file|is not a mesh file|cannot be read|no triangles"):
        open_scene(tmp_path / name)


def test_a_missing_gltf_texture_is_drawn_plain_and_stated(tmp_path):
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(y_up(textured(room()))))
    document = json.loads(files["model.gltf"])
    document["images"] = [{"uri": "gone.png"}]
    files["model.gltf"] = json.dumps(document).encode()
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    scene = open_scene(tmp_path / "model.gltf")
    notice(scene, "texture", "gone.png is missing")


def test_a_missing_obj_texture_is_drawn_plain_and_stated(tmp_path):
    (tmp_path / "room.mtl").write_text("newmtl wall\nKd 0.5 0.6 0.7\nmap_Kd nowhere.png\n")
    mesh = tessellated(room())
    lines = ["mtllib room.mtl"]
    lines += [f"v {x} {y} {z}" for x, y, z in np.asarray(mesh.vertices)]
    lines += ["vt 0 0", "usemtl wall"]
    lines += [f"f {a}/1 {b}/1 {c}/1" for a, b, c in np.asarray(mesh.faces) + 1]
    (tmp_path / "room.obj").write_text("\n".join(lines) + "\n")
    scene = open_scene(tmp_path / "room.obj")
    notice(scene, "nowhere.png is missing")
    factor = scene.mesh.materials[scene.mesh.material_index[0]].factor
    np.testing.assert_allclose(factor, [0.5, 0.6, 0.7], atol=0.01)


def test_a_scene_without_room_for_the_robot_is_refused(tmp_path):
    y_up(textured(with_boxes(((-2.9, -1.9, 0.0), (2.9, 1.9, 0.9))))).export(tmp_path / "full.glb")
    with pytest.raises(SceneError, match="no free floor for a robot of radius"):
        open_scene(tmp_path / "full.glb")
    y_up(textured(quad([(0, -2, 0), (0, 2, 0), (0, 2, 2.5), (0, -2, 2.5)]))).export(tmp_path / "wall.glb")
    with pytest.raises(SceneError, match="no level surface"):
        open_scene(tmp_path / "wall.glb")


def test_the_start_comes_from_the_file_beside_it_where_the_robot_fits(tmp_path):
    y_up(textured(with_boxes(BLOCK))).export(tmp_path / "room.glb")
    (tmp_path / "room.json").write_text(json.dumps({"start": {"xyz": [-1.5, 0.5, 1.2], "yaw_deg": 90.0}}))
    start = open_scene(tmp_path / "room.glb").start
    assert (start.x_m, start.y_m) == (-1.5, 0.5)
    assert start.yaw_rad == pytest.approx(np.pi / 2)
    given = SceneOptions(start=StartOptions(x_m=-2.0, y_m=-1.0, yaw_deg=-90.0))
    assert open_scene(tmp_path / "room.glb", given).start.x_m == -2.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"start": {"xyz": [1.0, 0.8, 1.2], "yaw_deg": 0}}', "cannot be used: an obstacle is 0.00 m away"),
        ('{"start": {"xyz": [50.0, 0.8, 1.2], "yaw_deg": 0}}', "cannot be used: there is no floor"),
        ('{"start": {}}', "no usable start"),
        ("[not json", "no usable start"),
    ],
)
def test_a_start_that_cannot_be_used_is_replaced_and_stated(tmp_path, text, words):
    y_up(textured(with_boxes(BLOCK))).export(tmp_path / "room.glb")
    (tmp_path / "room.json").write_text(text)
    scene = open_scene(tmp_path / "room.glb")
    notice(scene, words)
    assert scene.caster.distance_to_surface(np.array([scene.start.x_m, scene.start.y_m, 0.5])) > 0.25


def test_built_in_names():
    assert list(scene_names()) == ["house", "building", "warren", "live"]
    with pytest.raises(SceneError, match="where a robot really is"):
        open_scene("live")
    for name in BUILT_IN_SCENES:
        with pytest.raises(SceneError, match=f"expected {name} or {name}:SEED"):
            open_scene(f"{name}:blue")


@pytest.mark.parametrize(
    ("name", "area_m2", "notices"),
    [("aws_small_house", 217, 1), ("aws_bookstore", 229, 0), ("pal_home", 267, 0)],
)
def test_third_party_scenes_open_at_their_start(shared_dir, name, area_m2, notices):
    path = shared_dir / "scenes" / f"{name}.glb"
    facts = json.loads(path.with_suffix(".json").read_text())
    scene = open_scene(path)
    assert len(scene.mesh.triangles) == facts["triangles"]
    assert [scene.start.x_m, scene.start.y_m] == facts["start"]["xyz"][:2]
    assert len(scene.notices) == notices
    assert np.prod(scene.bounds.size_m[:2]) == pytest.approx(area_m2, rel=0.02)
    np.testing.assert_allclose(scene.bounds.lower_m[:2], facts["bbox"][0][:2], atol=0.02)
