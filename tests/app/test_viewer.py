import asyncio
import time
from dataclasses import replace

import httpx
import msgspec
import numpy as np
import psutil
import pytest
import viser
import websockets.asyncio.server
from viser import _messages
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.errors import Forbidden
from app.missions.display import (
    MAX_CANDIDATES,
    MAX_EDGES,
    MAX_SUBSPACES,
    MAX_VOXELS,
    PANORAMA_PX,
    DisplayView,
)
from app.settings import DisplaySettings
from app.viewer.areas import hatches
from app.viewer.framing import CameraMode
from app.viewer.mesh import MAX_TRIANGLES, coarse
from app.viewer.palette import as_linear
from app.viewer.polyline import padded_segments
from app.viewer.scene import MissionScene
from app.viewer.server import proof_headers
from app.viewer.splats import TILE
from app.viewer.subspaces import lowest_of_each_column
from hgs_core.evaluation.colour_maps import ramp
from hgs_core.geometry.polygons import contains, distance_m
from hgs_core.mapping.mesh_file import write_mesh
from hgs_core.mapping.volume_fusion import SurfaceMesh
from tests.app.conftest import wait_until


def display(n_splats: int = 100, n_candidates: int = 3, time_s: float = 1.0) -> DisplayView:
    """A view of a flat room, of any size."""
    rng = np.random.default_rng(n_splats)
    image = np.zeros((4, 6, 3), np.uint8)
    pose = np.eye(4)
    pose[:3, 3] = (1.0, 2.0, 1.0)
    return DisplayView(
        time_s=time_s,
        n_gaussians=n_splats,
        splat_centres_m=rng.uniform([0, 0, 0], [8, 5, 3], (n_splats, 3)).astype(np.float32),
        splat_rgb=rng.integers(0, 255, (n_splats, 3)).astype(np.uint8),
        splat_radii_m=np.full(n_splats, 0.004, np.float32),
        splat_normals=np.zeros((n_splats, 0), np.float32),
        splat_opacities=np.full(n_splats, 200, np.uint8),
        splat_quality=np.linspace(0, 255, n_splats).astype(np.uint8),
        voxel_centres_m=rng.uniform([0, 0, 0], [8, 5, 3], (3 * n_candidates, 3)).astype(np.float32),
        voxel_kinds=np.tile(np.arange(3, dtype=np.uint8), n_candidates),
        voxel_size_m=np.array([0.1], np.float32),
        roadmap_m=rng.uniform(0, 5, (n_candidates, 2, 2)).astype(np.float32),
        panorama_m=np.array([[1.0, 2.0, 1.0]], np.float32)[: n_candidates or 0],
        panorama=np.full((*PANORAMA_PX, 3), 90, np.uint8),
        region_m=np.array([[0, 0], [4, 0], [4, 4], [0, 4]], np.float32),
        no_go_m=np.array([[1, 1], [2, 1], [2, 2], [5, 5], [6, 5], [5, 6]], np.float32),
        no_go_sizes=np.array([3, 3], np.uint8),
        trajectory_m=rng.uniform(0, 5, (7, 3)).astype(np.float32),
        subspace_bounds_m=np.array([[0, 0, 0, 4, 4, 3], [4, 0, 0, 8, 4, 3]], np.float32),
        subspace_states=np.array([0, 1], np.uint8),
        candidate_poses=rng.uniform(0, 3, (n_candidates, 4)).astype(np.float32),
        candidate_gains=rng.uniform(0, 3, (n_candidates, 3)).astype(np.float32),
        candidate_statuses=np.zeros(n_candidates, np.uint8),
        global_tour_m=rng.uniform(0, 5, (4, 3)).astype(np.float32),
        local_path_m=rng.uniform(0, 5, (3, 3)).astype(np.float32),
        T_world_camera=pose,
        camera=np.array([1200.0, 680.0, 600.0, 600.0]),
        observed=image,
        rendered=image,
        depth=image,
        quality=image,
    )


@pytest.fixture
def scene():
    scene = MissionScene(DisplaySettings(interval_s=0.05))
    yield scene
    scene.close()


def node(scene: MissionScene, name: str):
    found = scene.server.scene.get_handle_by_name(name)
    assert found is not None, name
    return found


def nodes(scene: MissionScene) -> set[str]:
    return set(scene.server.scene._handle_from_node_name)


def test_it_listens_on_this_machine_only(scene):
    port = scene.server.get_port()
    listening = [
        connection.laddr.ip
        for connection in psutil.Process().net_connections(kind="tcp")
        if connection.status == psutil.CONN_LISTEN and connection.laddr.port == port
    ]
    assert listening == ["127.0.0.1"]


def test_nobody_can_ask_for_a_public_tunnel(scene, monkeypatch, caplog):
    server = scene.server
    opened = []
    monkeypatch.setattr(viser._viser, "ViserTunnel", lambda *a, **k: opened.append(a))
    handlers = server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers
    assert _messages.ShareUrlDisconnect not in handlers
    with pytest.raises(Forbidden):
        server.request_share_url()

    # Not even when a handler comes back, as after an update of viser.
    reached = []
    server._websock_server.register_handler(_messages.ShareUrlRequest, lambda *a: reached.append(a))
    asyncio.run(server._websock_server._handle_incoming_message(0, _messages.ShareUrlRequest()))
    assert reached == []

    # And as a client would send it.
    url = scene.url.replace("http", "ws")
    protocols = [f"viser-v{viser.__version__}"]
    with connect(url, subprotocols=protocols, additional_headers=proof_headers(), max_size=None) as client:
        client.send(msgspec.msgpack.encode({"type": "ShareUrlRequest"}))
        deadline = time.monotonic() + 20
        while len(caplog.records) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
    assert [record.message for record in caplog.records] == [
        "viewer client 0 asked for a public tunnel; refused"
    ] * 2
    assert reached == []
    assert opened == []
    assert server._share_tunnel is None


@pytest.mark.parametrize(
    "headers", [{}, {"X-HGS-Proof": ""}, {"X-HGS-Proof": "guess"}, {"Origin": "http://127.0.0.1"}]
)
def test_nobody_reaches_it_but_the_service(scene, headers):
    """Any page in the operator's browser, and any other user of this machine, can open the port."""
    url = scene.url.replace("http", "ws")
    with pytest.raises(InvalidStatus) as refusal, connect(url, additional_headers=headers):
        pass
    assert refusal.value.response.status_code == 403
    assert httpx.get(scene.url, headers=headers).status_code == 403
    assert scene.server.get_clients() == {}


def test_what_keeps_strangers_out_leaves_the_websocket_library_as_it_was(scene):
    assert websockets.asyncio.server.serve.__module__ == "websockets.asyncio.server"


def test_splats_keep_their_buffers_whatever_the_map_does(scene):
    scene._draw(display(100))
    first = node(scene, "/gaussians/0")
    assert first.buffer.shape == (TILE, 8)
    names = nodes(scene)
    for size in (1000, 50, TILE):
        scene._draw(display(size))
        assert node(scene, "/gaussians/0") is first
        assert first.buffer.shape == (TILE, 8)
    assert nodes(scene) == names
    scene._draw(display(TILE + 1))
    assert nodes(scene) == names | {"/gaussians/1"}
    assert node(scene, "/gaussians/1").buffer.shape == (TILE, 8)


def test_unused_and_clipped_splats_are_transparent_and_small_ones_enlarged(scene):
    view = display(100)
    scene._draw(view)
    tile = node(scene, "/gaussians/0")
    alphas = tile.opacities[:, 0]
    below = view.splat_centres_m[:, 2] <= 2.2
    assert 0 < below.sum() < 100
    np.testing.assert_array_equal(alphas[:100] > 0, below)
    assert np.all(alphas[100:] == 0)
    np.testing.assert_allclose(tile.covariances[:100, 0, 0], 0.015**2, rtol=2e-3)
    np.testing.assert_allclose(tile.centers[:100], view.splat_centres_m)


def test_discs_are_flat_splats(scene):
    normals = np.tile(np.float32([0.0, 0.6, 0.8]), (100, 1))
    scene._draw(replace(display(100), splat_normals=normals, splat_radii_m=np.full(100, 0.1, np.float32)))
    covariances = node(scene, "/gaussians/0").covariances[:100]
    along = np.einsum("ni,nij,nj->n", normals, covariances, normals)
    np.testing.assert_allclose(along, 0.015**2, rtol=0.05)
    np.testing.assert_allclose(covariances[:, 0, 0], 0.1**2, rtol=2e-3)


def test_a_smaller_map_leaves_nothing_of_the_larger_one(scene):
    scene._draw(display(500, n_candidates=9))
    scene._draw(display(10, n_candidates=0))
    assert (node(scene, "/gaussians/0").opacities > 0).sum() <= 10
    assert np.all(node(scene, "/candidates").batched_scales == 0)


def test_a_drawing_that_fails_is_told_until_one_succeeds(scene, monkeypatch):
    def broken(_):
        raise ValueError("no such layer")

    with monkeypatch.context() as patched:
        patched.setattr(scene._layers[0], "update", broken)
        scene.show(display(10, time_s=7.0))
        wait_until(lambda: scene._trouble.visible)
        assert scene._trouble.content == "not up to date since 7 s of the mission: no such layer"
    scene.show(display(10, time_s=8.0))
    wait_until(lambda: not scene._trouble.visible)


def test_one_batched_node_a_layer_of_fixed_size(scene):
    for count in (0, 5, 40):
        scene._draw(display(10, n_candidates=count))
        marks = node(scene, "/candidates")
        assert marks.batched_positions.shape == (MAX_CANDIDATES, 3)
        assert (marks.batched_opacities > 0).sum() == count
        assert node(scene, "/subspaces/outlines").points.shape == (4 * MAX_SUBSPACES, 2, 3)
    assert len(nodes(scene)) < 30


def test_views_that_come_too_fast_are_skipped_and_the_newest_is_shown(scene):
    for number in range(200):
        scene.show(display(10, time_s=float(number)))
    deadline = time.monotonic() + 20
    while (scene._shown is None or scene._shown.time_s != 199.0) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert scene._shown.time_s == 199.0


def test_switches_hide_and_show_layers(scene):
    scene._draw(display(10))
    assert node(scene, "/gaussians/0").visible
    scene._layers[0].set_visible(False)
    assert not node(scene, "/gaussians/0").visible
    scene._layers[1].set_visible(True)
    scene._layers[1].update(display(10))
    assert node(scene, "/points/0").points.shape == (TILE, 3)


def layer(scene: MissionScene, title: str):
    return next(layer for layer in scene._layers if layer.title == title)


def test_voxels_travel_only_while_they_are_looked_at_and_end_at_the_clipping_height(scene):
    boxes, view = layer(scene, "Voxels"), display(10, n_candidates=40)
    scene._draw(view)
    assert not node(scene, "/voxels").batched_opacities.any()
    boxes.set_visible(True)
    scene._draw(view)
    below = view.voxel_centres_m[:, 2] <= 2.2
    assert node(scene, "/voxels").batched_positions.shape == (MAX_VOXELS, 3)
    assert (node(scene, "/voxels").batched_opacities > 0).sum() == below.sum() < 120
    assert node(scene, "/voxels").visible


def test_the_roadmap_has_one_node_of_fixed_size(scene):
    for n_edges in (7, 0):
        scene._draw(display(10, n_candidates=n_edges))
        points = node(scene, "/roadmap").points
        assert points.shape == (MAX_EDGES, 2, 3)
        assert np.any(points[:, 0] != points[:, 1], axis=1).sum() == n_edges


def test_areas_are_outlined_and_hatched_inside(scene):
    view = display(10)
    scene._draw(view)
    points = node(scene, "/areas").points
    drawn = points[np.any(points[:, 0] != points[:, 1], axis=1)]
    assert len(drawn) > 4 + 3 + 3
    triangle = view.no_go_m[3:]
    lines = hatches(triangle)
    assert len(lines) >= 2
    assert contains(triangle, lines.mean(axis=1)).all()
    assert distance_m(triangle, lines.reshape(-1, 2)).max() < 1e-5
    scene._draw(replace(view, region_m=np.zeros((0, 2), np.float32), no_go_sizes=np.zeros(0, np.uint8)))
    assert not np.any(node(scene, "/areas").points[:, 0] != node(scene, "/areas").points[:, 1])


def test_colours_tell_how_little_is_known(scene):
    view = display(100)
    scene._draw(view)
    scene._splats.shows_quality = True
    scene._draw(view)
    drawn = node(scene, "/gaussians/0").rgbs[:100]
    np.testing.assert_array_equal(drawn, ramp()[view.splat_quality])


def test_the_panorama_of_the_next_view_is_shown_while_there_is_one(scene):
    scene._draw(display(10))
    assert scene._panorama._mark.visible
    assert "From (1.0, 2.0)" in scene._panorama._text.content
    scene._draw(display(10, n_candidates=0))
    assert not scene._panorama._mark.visible


def test_a_mesh_is_drawn_as_coarse_as_is_needed(tmp_path):
    n = 600
    x, y = np.meshgrid(np.linspace(0, 8, n), np.linspace(0, 8, n), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(n * n)], axis=1).astype(np.float32)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate(
        [np.stack([corner, corner + n, corner + 1], 1), np.stack([corner + 1, corner + n, corner + n + 1], 1)]
    ).astype(np.int32)
    rgb = np.full((n * n, 3), 200, np.uint8)
    assert len(triangles) > MAX_TRIANGLES
    few, shown, colours = coarse(vertices, triangles, rgb)
    assert len(shown) <= MAX_TRIANGLES
    assert shown.max() < len(few) == len(colours)
    np.testing.assert_allclose(few.min(axis=0), [0, 0, 0], atol=0.05)
    np.testing.assert_allclose(few.max(axis=0), [8, 8, 0], atol=0.05)
    write_mesh(SurfaceMesh(vertices_m=few, triangles=shown, rgb=colours), tmp_path / "mesh.ply")
    scene = MissionScene(DisplaySettings(interval_s=0.05), tmp_path / "mesh.ply")
    assert "/mesh" not in nodes(scene)
    layer(scene, "Mesh (finished missions)").set_visible(True)
    assert "/mesh" in nodes(scene)
    scene.close()


def test_fresh_cameras_look_down_on_the_middle_of_the_map(scene):
    view = display(5000)
    scene._draw(view)
    camera = scene.server.initial_camera
    lower, upper = view.splat_centres_m.min(axis=0), view.splat_centres_m.max(axis=0)
    np.testing.assert_allclose(camera.look_at[:2], ((lower + upper) / 2)[:2], atol=0.2)
    assert camera.position[2] > 5.0
    scene._framing.choose(CameraMode.FOLLOW_ROBOT)
    scene._draw(view)


def test_a_polyline_fills_up_with_pieces_of_no_length():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0]], float)
    segments = padded_segments(points, 5)
    assert segments.shape == (5, 2, 3)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    np.testing.assert_allclose(lengths, [1, 2, 0, 0, 0])
    long = padded_segments(np.random.default_rng(0).normal(size=(1000, 3)), 5)
    assert long.shape == (5, 2, 3)
    np.testing.assert_array_equal(long[1:, 0], long[:-1, 1])
    assert not padded_segments(np.zeros((0, 3)), 5).any()


def test_a_column_of_subspaces_shows_its_most_urgent_state():
    bounds = np.array([[0, 0, 1, 1, 1, 2], [0, 0, 0, 1, 1, 1], [2, 0, 0, 3, 1, 1]], np.float32)
    chosen, states = lowest_of_each_column(bounds, np.array([0, 1, 2], np.uint8))
    assert [(tuple(b[:2]), int(s)) for b, s in zip(chosen, states, strict=True)] == [((0, 0), 1), ((2, 0), 2)]
    assert np.all(chosen[:, 2] == 0)


def test_linear_light_keeps_black_and_white():
    np.testing.assert_array_equal(as_linear(np.array([0, 255, 188], np.uint8)), [0, 255, 128])
