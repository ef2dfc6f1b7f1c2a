"""Textures of what a house is built of: floors, walls, ceilings, tiles, stone, brick."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.scene.procedural.noise import (
    Colour,
    Image,
    as_image,
    blended,
    fractal_noise,
    shaded,
    texel_grid,
    toned,
)


def planks(rng: np.random.Generator, colour: Colour, *, rows: int, texels: int = 600) -> Image:
    """Floorboards along u: `rows` of them, cut at random lengths, each with its own tone and grain."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    row = np.floor(v * rows).astype(int)
    shift = rng.random(rows)
    cuts = 2
    along = (u + shift[row]) * cuts
    board = row * cuts + (np.floor(along).astype(int) % cuts)
    tone = rng.normal(0.0, 0.09, rows * cuts)[board]
    grain = fractal_noise(shape, rng, falloff=1.1, stretch=14.0)
    rings = np.sin(9.0 * fractal_noise(shape, rng, falloff=2.0, stretch=6.0) + 7.0 * tone * 10)
    relative = tone + 0.05 * grain + 0.035 * rings
    image = shaded(colour, relative)
    to_row_edge = np.minimum(v * rows % 1.0, 1.0 - v * rows % 1.0) / rows
    to_cut = np.minimum(along % 1.0, 1.0 - along % 1.0) / cuts
    seam = np.minimum(np.broadcast_to(to_row_edge, shape), to_cut) * texels
    return as_image(blended(image, toned(colour, 0.45), 0.75 * (1.8 - seam)))


def herringbone(rng: np.random.Generator, colour: Colour, *, blocks: int = 6, texels: int = 576) -> Image:
    """Parquet squares of four strips each, turned by 90 degrees from square to square."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    square_v, square_u = np.floor(v * blocks).astype(int), np.floor(u * blocks).astype(int)
    upright = (square_v + square_u) % 2 == 1
    across = np.where(upright, u * blocks % 1.0, v * blocks % 1.0) * 4
    strip = (square_v * blocks + square_u) * 4 + np.floor(across).astype(int)
    tone = rng.normal(0.0, 0.08, blocks * blocks * 4)[strip]
    lying = fractal_noise(shape, rng, falloff=1.1, stretch=10.0)
    grain = np.where(upright, lying.T, lying)
    image = shaded(colour, tone + 0.05 * grain)
    to_edge = np.minimum(across % 1.0, 1.0 - across % 1.0) / 4
    square_edge = np.minimum(
        np.minimum(u * blocks % 1.0, 1 - u * blocks % 1.0), np.minimum(v * blocks % 1.0, 1 - v * blocks % 1.0)
    )
    seam = np.minimum(to_edge, square_edge) / blocks * texels
    return as_image(blended(image, toned(colour, 0.5), 0.7 * (1.6 - seam)))


def tiles(
    rng: np.random.Generator,
    colours: tuple[Colour, Colour],
    grout: Colour,
    *,
    count: int,
    texels: int = 512,
    veined: bool = False,
) -> Image:
    """`count` x `count` square tiles, chequered in two colours, with grout and (if `veined`) marbling."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    tile_v, tile_u = np.floor(v * count).astype(int), np.floor(u * count).astype(int)
    first = ((tile_v + tile_u) % 2 == 0)[..., None]
    base = np.where(first, np.asarray(colours[0], float), np.asarray(colours[1], float))
    tone = rng.normal(0.0, 0.035, count * count)[tile_v * count + tile_u]
    relative = tone + 0.025 * fractal_noise(shape, rng, falloff=1.4)
    if veined:
        relative -= 0.16 * veins(shape, rng)
    image = shaded(base, relative)
    to_edge = np.minimum(
        np.minimum(u * count % 1.0, 1 - u * count % 1.0), np.minimum(v * count % 1.0, 1 - v * count % 1.0)
    )
    return as_image(blended(image, grout, (2.0 - to_edge / count * texels)))


def veins(shape: tuple[int, int], rng: np.random.Generator) -> Float[ndarray, "height width"]:
    """Thin bright lines where smooth noise crosses zero, as in marble: 1 on a vein, 0 away from it."""
    ridge = np.exp(-np.abs(fractal_noise(shape, rng, falloff=1.7)) * 9.0)
    return ridge * np.clip(0.5 + 0.6 * fractal_noise(shape, rng, falloff=2.0), 0.0, 1.0)


def marble(rng: np.random.Generator, colour: Colour, vein_colour: Colour, *, texels: int = 480) -> Image:
    shape = (texels, texels)
    image = shaded(colour, 0.035 * fractal_noise(shape, rng, falloff=1.8))
    image = blended(image, vein_colour, 0.6 * veins(shape, rng))
    return as_image(blended(image, vein_colour, 0.35 * veins(shape, rng)))


def bricks(
    rng: np.random.Generator, colour: Colour, mortar: Colour, *, rows: int = 16, texels: int = 512
) -> Image:
    """Running bond: every other row shifted by half a brick."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    columns = rows // 4
    row = np.floor(v * rows).astype(int)
    along = u * columns + 0.5 * (row % 2)
    brick = row * columns + np.floor(along).astype(int) % columns
    tone = rng.normal(0.0, 0.11, rows * columns)[brick]
    hue = rng.normal(0.0, 9.0, (rows * columns, 3))[brick]
    image = shaded(colour, tone + 0.06 * fractal_noise(shape, rng, falloff=1.0)) + hue
    across = np.broadcast_to(np.minimum(v * rows % 1.0, 1 - v * rows % 1.0) / rows, shape)
    to_edge = np.minimum(across, np.minimum(along % 1.0, 1 - along % 1.0) / columns) * texels
    return as_image(blended(image, mortar, 3.2 - to_edge))


def plaster(rng: np.random.Generator, colour: Colour, *, texels: int = 512, contrast: float = 1.0) -> Image:
    """Painted plaster: trowel marks, stains and fine grain."""
    shape = (texels, texels)
    relative = (
        0.030 * fractal_noise(shape, rng, falloff=1.9)
        + 0.016 * fractal_noise(shape, rng, falloff=1.2, stretch=3.0, coarsest=8.0)
        + 0.012 * fractal_noise(shape, rng, falloff=0.6, coarsest=30.0)
    )
    return as_image(shaded(colour, contrast * relative))


def striped_wallpaper(
    rng: np.random.Generator, colours: tuple[Colour, Colour], *, stripes: int = 12, texels: int = 512
) -> Image:
    """Upright stripes with a thin line beside each."""
    shape = (texels, texels)
    _, u = texel_grid(shape)
    phase = np.broadcast_to(u * stripes % 1.0, shape)
    image = np.where((phase < 0.5)[..., None], np.asarray(colours[0], float), np.asarray(colours[1], float))
    line = np.exp(-(((phase - 0.62) / 0.03) ** 2)) + np.exp(-(((phase - 0.88) / 0.03) ** 2))
    image = blended(image, colours[0], 0.9 * line)
    return as_image(shaded(image, 0.02 * fractal_noise(shape, rng, falloff=1.3)))


def motif_wallpaper(
    rng: np.random.Generator, ground: Colour, print_colour: Colour, *, repeats: int = 8, texels: int = 512
) -> Image:
    """A damask: four-petalled flowers and diamonds on a half-shifted lattice."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    image = shaded(ground, 0.02 * fractal_noise(shape, rng, falloff=1.4))
    for shift in (0.0, 0.5):
        y = (v * repeats + shift) % 1.0 - 0.5
        x = (u * repeats + shift) % 1.0 - 0.5
        radius, angle = np.hypot(x, y), np.arctan2(y, x)
        petal = 0.13 + 0.10 * np.cos(4 * angle)
        flower = np.clip((petal - radius) * 40, 0, 1) * (0.65 + 0.35 * np.cos(radius * 60))
        ring = np.exp(-(((np.abs(x) + np.abs(y) - 0.42) / 0.025) ** 2))
        image = blended(image, print_colour, 0.8 * flower + 0.5 * ring)
    return as_image(image)


def ceiling_plaster(rng: np.random.Generator, colour: Colour, *, panels: int = 4, texels: int = 512) -> Image:
    """Ceiling boards: stippled paint, shallow joints between panels."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    relative = 0.022 * fractal_noise(shape, rng, falloff=1.8) + 0.018 * fractal_noise(
        shape, rng, falloff=0.7, coarsest=24.0
    )
    to_edge = np.minimum(
        np.minimum(u * panels % 1.0, 1 - u * panels % 1.0), np.minimum(v * panels % 1.0, 1 - v * panels % 1.0)
    )
    image = shaded(colour, relative)
    return as_image(blended(image, toned(colour, 0.8), 0.8 * (2.2 - to_edge / panels * texels)))
