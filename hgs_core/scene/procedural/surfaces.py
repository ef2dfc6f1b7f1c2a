"""The materials of one house: every surface that its rooms and furniture are covered with."""

from __future__ import annotations

import numpy as np

from hgs_core.scene.procedural import object_textures as objects
from hgs_core.scene.procedural import wall_textures as walls
from hgs_core.scene.procedural.mesh_builder import Surface
from hgs_core.scene.procedural.noise import Colour, Image

N_PICTURES = 9
N_VIEWS = 4

_WOODS: tuple[tuple[Colour, Colour, Colour], ...] = (
    ((118, 76, 46), (196, 156, 108), (158, 112, 70)),
    ((94, 62, 44), (206, 172, 124), (146, 98, 62)),
    ((104, 72, 54), (188, 148, 104), (170, 122, 82)),
)
_PLASTERS: tuple[Colour, ...] = (
    (222, 210, 188),
    (206, 214, 206),
    (214, 204, 196),
    (226, 216, 176),
    (198, 208, 218),
)
_CLOTHS: tuple[Colour, ...] = ((86, 106, 128), (136, 86, 70), (104, 122, 96), (150, 130, 102), (112, 92, 118))
_RUGS: tuple[tuple[Colour, tuple[Colour, Colour]], ...] = (
    ((150, 52, 46), ((40, 52, 82), (220, 196, 150))),
    ((46, 74, 98), ((208, 180, 134), (160, 76, 60))),
    ((196, 176, 140), ((122, 66, 54), (70, 92, 92))),
    ((76, 96, 80), ((214, 192, 150), (156, 86, 62))),
)

Surfaces = dict[str, Surface]


class _Palette:
    """Collects surfaces; textures draw from one random stream, in the order they are added."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.surfaces: Surfaces = {}

    def add(self, name: str, texture: Image, size_m: float | None, *, grain: bool = False) -> None:
        """A surface one copy of whose texture is `size_m` wide (None: it fits each face)."""
        size = None if size_m is None else (size_m, size_m * texture.shape[0] / texture.shape[1])
        self.surfaces[name] = Surface(name=name, texture=texture, size_m=size, grain=grain)


def house_surfaces(rng: np.random.Generator) -> Surfaces:
    """All surfaces by name; colours are chosen by `rng` from palettes that go together."""
    woods = _WOODS[rng.integers(len(_WOODS))]
    palette = _Palette(rng)
    _add_structure(palette, woods)
    _add_wood(palette, woods)
    _add_cloth(palette)
    _add_pictures(palette)
    _add_small_things(palette)
    return palette.surfaces


def _add_structure(palette: _Palette, woods: tuple[Colour, Colour, Colour]) -> None:
    rng, add = palette.rng, palette.add
    _, light, middle = woods
    plaster = [_PLASTERS[k] for k in rng.permutation(len(_PLASTERS))]
    add("floor_living", walls.planks(rng, middle, rows=16), 2.4)
    add("floor_hall", walls.planks(rng, light, rows=14), 2.4)
    add("floor_bedroom", walls.herringbone(rng, light), 2.3)
    add("floor_study", walls.herringbone(rng, middle, blocks=8), 2.3)
    add("floor_kitchen", walls.tiles(rng, ((206, 196, 180), (150, 120, 98)), (120, 112, 104), count=6), 2.4)
    add(
        "floor_bath",
        walls.tiles(rng, ((198, 206, 208), (112, 132, 140)), (230, 230, 226), count=8, veined=True),
        1.8,
    )
    add("threshold", objects.wood(rng, woods[0]), 1.2, grain=True)
    add("ceiling", walls.ceiling_plaster(rng, (232, 228, 220)), 3.2)
    add("wall_living", walls.plaster(rng, plaster[0]), 2.6)
    add("wall_accent", walls.bricks(rng, (166, 98, 76), (196, 188, 176)), 1.3)
    add("wall_hall", walls.striped_wallpaper(rng, ((216, 206, 184), (190, 172, 142))), 1.6)
    add("wall_bedroom", walls.motif_wallpaper(rng, (196, 206, 200), (118, 142, 140)), 2.2)
    add("wall_study", walls.motif_wallpaper(rng, (214, 200, 164), (150, 110, 80), repeats=6), 2.2)
    add("wall_kitchen", walls.plaster(rng, plaster[1], contrast=1.2), 2.6)
    add("wall_bath", walls.tiles(rng, ((206, 220, 220), (184, 204, 208)), (236, 236, 232), count=10), 2.0)
    add("wall_upper", walls.plaster(rng, plaster[2]), 2.6)
    add("backsplash", walls.tiles(rng, ((226, 222, 210), (86, 120, 140)), (214, 210, 200), count=8), 0.96)
    add("panelling", objects.cupboard_front(rng, (206, 200, 186), doors=1, drawers=0), 0.8)
    add("worktop", walls.marble(rng, (74, 74, 78), (176, 172, 166)), 1.2)
    add("marble", walls.marble(rng, (224, 220, 214), (128, 122, 118)), 1.2)
    add("trim", objects.painted_wood(rng, (222, 216, 202)), 1.0, grain=True)


def _add_wood(palette: _Palette, woods: tuple[Colour, Colour, Colour]) -> None:
    rng, add = palette.rng, palette.add
    dark, light, middle = woods
    add("wood_dark", objects.wood(rng, dark), 1.2, grain=True)
    add("wood_light", objects.wood(rng, light), 1.2, grain=True)
    add("wood_middle", objects.wood(rng, middle), 1.2, grain=True)
    add("paint_white", objects.painted_wood(rng, (220, 216, 206)), 1.0, grain=True)
    add("paint_colour", objects.painted_wood(rng, _CLOTHS[rng.integers(len(_CLOTHS))]), 1.0, grain=True)
    add("front_wardrobe", objects.cupboard_front(rng, middle, doors=3, drawers=0), None)
    add("front_drawers", objects.cupboard_front(rng, light, doors=0, drawers=4), None)
    add("front_cabinet", objects.cupboard_front(rng, dark, doors=2, drawers=0), None)
    add("front_kitchen", objects.cupboard_front(rng, (150, 164, 156), doors=2, drawers=0), None)
    add("front_kitchen_drawers", objects.cupboard_front(rng, (150, 164, 156), doors=0, drawers=3), None)
    add("front_nightstand", objects.cupboard_front(rng, middle, doors=0, drawers=2), None)
    add("paint_kitchen", objects.painted_wood(rng, (150, 164, 156)), 1.0, grain=True)


def _add_cloth(palette: _Palette) -> None:
    rng, add = palette.rng, palette.add
    cloths = [_CLOTHS[k] for k in rng.permutation(len(_CLOTHS))]
    rugs = [_RUGS[k] for k in rng.permutation(len(_RUGS))]
    add("sofa", objects.fabric(rng, cloths[0]), 0.7)
    add("armchair", objects.plaid(rng, cloths[1], ((196, 176, 140), (60, 56, 64))), 0.6)
    add("chair_seat", objects.fabric(rng, cloths[2]), 0.5)
    add("cushion_a", objects.plaid(rng, (206, 180, 120), (cloths[3], (90, 60, 50))), 0.4)
    add("cushion_b", walls.motif_wallpaper(rng, cloths[4], (222, 208, 178), repeats=4, texels=256), 0.5)
    add("linen", objects.fabric(rng, (222, 216, 204)), 0.8)
    add("blanket", objects.plaid(rng, cloths[3], ((212, 196, 160), (72, 52, 52))), 0.9)
    add("curtain", walls.striped_wallpaper(rng, (cloths[4], (206, 190, 164)), stripes=8), 1.2)
    add("towel", walls.striped_wallpaper(rng, ((214, 222, 224), cloths[0]), stripes=6, texels=256), 0.5)
    for name, (ground, accents) in zip(("rug_a", "rug_b", "rug_c", "rug_d"), rugs, strict=True):
        add(name, objects.rug(rng, ground, accents), None)


def _add_pictures(palette: _Palette) -> None:
    rng, add = palette.rng, palette.add
    kinds = (objects.landscape, objects.abstract_painting, objects.circles_painting)
    for k in range(N_PICTURES):
        add(f"picture_{k}", kinds[k % 3](rng), None)
    for k in range(N_VIEWS):
        add(f"view_{k}", objects.landscape(rng, texels=(360, 360)), None)
    for k in range(3):
        add(f"spines_{k}", objects.book_spines(rng), None)
    add("screen", objects.screen(rng), None)


def _add_small_things(palette: _Palette) -> None:
    rng, add = palette.rng, palette.add
    add("metal", objects.brushed_metal(rng), 0.6, grain=True)
    add("metal_dark", objects.brushed_metal(rng, (74, 72, 74)), 0.6, grain=True)
    add("brass", objects.brushed_metal(rng, (182, 148, 84)), 0.5, grain=True)
    add("ceramic", walls.marble(rng, (228, 228, 224), (178, 186, 192), texels=320), 0.9)
    add("terracotta", walls.plaster(rng, (178, 106, 76), texels=256, contrast=2.0), 0.5)
    add("soil", walls.plaster(rng, (74, 56, 44), texels=128, contrast=3.5), 0.2)
    add("leaf", objects.leaf(rng), None)
    add(
        "shade", walls.striped_wallpaper(rng, ((232, 214, 170), (214, 186, 134)), stripes=16, texels=256), 0.6
    )
    add(
        "paper",
        walls.tiles(rng, ((228, 220, 200), (214, 204, 182)), (180, 168, 146), count=12, texels=192),
        0.3,
    )
    add("oven", objects.oven_front(rng), None)
    add("mirror", walls.marble(rng, (176, 196, 206), (222, 232, 236), texels=320), 1.1)
