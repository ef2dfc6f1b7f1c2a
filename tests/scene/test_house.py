import numpy as np
import pytest

from hgs_core.scene.free_floor import FreeFloor, choose_start
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.procedural.furnishing import furnish
from hgs_core.scene.procedural.layout import CEILING_M, draw_building, draw_layout
from hgs_core.scene.procedural.mesh_builder import MeshBuilder, Surface
from hgs_core.scene.procedural.shell import build_shell
from hgs_core.scene.procedural.surfaces import house_surfaces
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import open_scene


class PlainSurfaces(dict):
    """Every name is a surface of one tiny texture: geometry without the cost of drawing textures."""

    def __missing__(self, name):
        self[name] = Surface(name=name, texture=np.full((2, 2, 3), 128, dtype=np.uint8), size_m=(1.0, 1.0))
        return self[name]


def plain(draw, seed):
    """Layout and furnished mesh of `draw`, without the cost of drawing textures."""
    layout_seed, _, furniture_seed = np.random.SeedSequence(seed).spawn(3)
    layout = draw(np.random.default_rng(layout_seed))
    builder = MeshBuilder()
    build_shell(builder, layout, PlainSurfaces())
    furnish(builder, layout, PlainSurfaces(), np.random.default_rng(furniture_seed))
    return layout, builder.mesh()


@pytest.fixture(scope="module")
def house():
    return open_scene("house")


@pytest.mark.parametrize("seed", range(40))
def test_layouts_keep_their_promises(seed):
    layout = draw_layout(np.random.default_rng(seed))
    assert 70 <= layout.area_m2 <= 110
    assert 5 <= len(layout.rooms) <= 6
    for room in layout.rooms:
        assert min(room.x[1] - room.x[0], room.y[1] - room.y[0]) >= 1.45
    for doorway in layout.doorways:
        assert doorway.along[1] - doorway.along[0] >= 0.95
        for number in doorway.rooms:
            extent = layout.rooms[number].y if doorway.across_x else layout.rooms[number].x
            assert extent[0] <= doorway.along[0]
            assert doorway.along[1] <= extent[1]
    for a, first in enumerate(layout.rooms):
        for second in layout.rooms[a + 1 :]:
            assert (
                first.x[1] <= second.x[0]
                or second.x[1] <= first.x[0]
                or first.y[1] <= second.y[0]
                or second.y[1] <= first.y[0]
            )
    for window in layout.windows:
        extent = layout.rooms[window.room].y if window.side in "xX" else layout.rooms[window.room].x
        assert extent[0] < window.along[0] < window.along[1] < extent[1]
        assert window.z[1] < CEILING_M


@pytest.mark.parametrize("seed", range(20))
def test_office_floors_are_large_and_their_rooms_lie_apart(seed):
    layout = draw_building(np.random.default_rng(seed))
    assert 1000 <= layout.area_m2 <= 1300
    for a, first in enumerate(layout.rooms):
        assert min(first.x[1] - first.x[0], first.y[1] - first.y[0]) >= 1.9
        for second in layout.rooms[a + 1 :]:
            apart_x = max(second.x[0] - first.x[1], first.x[0] - second.x[1])
            apart_y = max(second.y[0] - first.y[1], first.y[0] - second.y[1])
            assert max(apart_x, apart_y) >= 0.13
    for doorway in layout.doorways:
        for number in doorway.rooms:
            extent = layout.rooms[number].y if doorway.across_x else layout.rooms[number].x
            assert extent[0] <= doorway.along[0]
            assert doorway.along[1] <= extent[1]
    reached = {0}
    for _ in layout.rooms:
        reached |= {k for doorway in layout.doorways if reached & set(doorway.rooms) for k in doorway.rooms}
    assert len(reached) == len(layout.rooms)


@pytest.mark.parametrize(
    ("draw", "seed"), [(draw_layout, 1), (draw_layout, 3), (draw_building, 0), (draw_building, 2)]
)
def test_the_robot_reaches_every_furnished_room(draw, seed):
    layout, mesh = plain(draw, seed)
    caster = RayCaster(mesh)
    start = choose_start(caster, 0.25, 1.1)
    floor = FreeFloor.of(caster, BodyObstacles(caster.mesh, 1.1))
    reached = floor.reachable(start.x_m, start.y_m, 0.30)
    cells = floor.cells_m
    for room in layout.rooms:
        inside = (
            (cells[..., 0] > room.x[0])
            & (cells[..., 0] < room.x[1])
            & (cells[..., 1] > room.y[0])
            & (cells[..., 1] < room.y[1])
        )
        assert np.mean(reached[inside]) > 0.15, room.role


def test_the_house_is_closed(house):
    """Rays from where the robot stands never leave it."""
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((5000, 3))
    origin = np.array([house.start.x_m, house.start.y_m, 1.0])
    assert np.isfinite(house.caster.cast(np.broadcast_to(origin, directions.shape), directions)).all()


def test_the_house_is_a_home(house):
    layout_area = house.bounds.size_m[0] * house.bounds.size_m[1]
    assert layout_area > 70
    assert abs(house.bounds.lower_m[2]) < 2e-3
    assert house.bounds.upper_m[2] == pytest.approx(CEILING_M, abs=5e-3)
    assert 10_000 < len(house.mesh.triangles) < 100_000
    assert len(house.mesh.materials) > 50
    assert house.notices == ()


def test_no_surface_is_flat_in_colour(house):
    for material in house.mesh.materials:
        assert material.texture is not None
        assert material.texture.std(axis=(0, 1)).max() > 2.0, material.name


def test_textures_are_detailed_where_they_cover_much(house):
    mesh = house.mesh
    areas = np.bincount(mesh.material_index, weights=mesh.areas_m2)
    edges = mesh.uv[:, 1:] - mesh.uv[:, :1]
    uv_area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    for k in np.argsort(areas)[-12:]:
        texture = mesh.materials[k].texture
        texels = uv_area[mesh.material_index == k].sum() * texture.shape[0] * texture.shape[1]
        assert np.sqrt(areas[k] / texels) < 0.008, mesh.materials[k].name


def test_the_same_seed_gives_the_same_house_and_another_gives_another(house):
    again = plain(draw_layout, 0)[1]
    np.testing.assert_array_equal(again.vertices_m, house.mesh.vertices_m)
    np.testing.assert_array_equal(again.triangles, house.mesh.triangles)
    assert draw_layout(np.random.default_rng(1)) != draw_layout(np.random.default_rng(0))


def test_the_same_seed_gives_the_same_textures(house):
    _, surface_seed, _ = np.random.SeedSequence(0).spawn(3)
    surfaces = house_surfaces(np.random.default_rng(surface_seed))
    for material in house.mesh.materials:
        np.testing.assert_array_equal(surfaces[material.name].texture, material.texture)
    for name, surface in surfaces.items():
        assert surface.name == name
        assert surface.size_m is None or min(surface.size_m) > 0.1
