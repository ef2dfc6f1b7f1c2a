"""Furnished worlds from a seed: a house, and a floor of an office building."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hgs_core.scene.options import StartOptions
from hgs_core.scene.procedural.furnishing import furnish
from hgs_core.scene.procedural.layout import Layout, draw_building, draw_layout
from hgs_core.scene.procedural.mesh_builder import MeshBuilder
from hgs_core.scene.procedural.shell import build_shell
from hgs_core.scene.procedural.surfaces import house_surfaces
from hgs_core.scene.procedural.warren import draw_start, draw_warren
from hgs_core.scene.textured_mesh import TexturedMesh


def build_house(seed: int) -> TexturedMesh:
    """Five or six furnished rooms, floor at z = 0; the same seed gives the same house."""
    return _built(draw_layout, seed)


def build_building(seed: int) -> TexturedMesh:
    """An office floor of more than 1000 m2, furnished by the same hands as the house."""
    return _built(draw_building, seed)


def build_warren(seed: int) -> TexturedMesh:
    """One furnished room or many, with narrow corridors and doors, loops and dead ends."""
    return _built(draw_warren, seed)


def warren_start(seed: int) -> StartOptions | None:
    """Where the robot starts in the warren of that seed; None: anywhere that is free."""
    layout_seed, _, _, start_seed = np.random.SeedSequence(seed).spawn(4)
    return draw_start(draw_warren(np.random.default_rng(layout_seed)), np.random.default_rng(start_seed))


def _built(draw: Callable[[np.random.Generator], Layout], seed: int) -> TexturedMesh:
    """Layout, surfaces and furniture draw from streams of their own."""
    layout_seed, surface_seed, furniture_seed = np.random.SeedSequence(seed).spawn(3)
    layout = draw(np.random.default_rng(layout_seed))
    surfaces = house_surfaces(np.random.default_rng(surface_seed))
    builder = MeshBuilder()
    build_shell(builder, layout, surfaces)
    furnish(builder, layout, surfaces, np.random.default_rng(furniture_seed))
    return builder.mesh()
