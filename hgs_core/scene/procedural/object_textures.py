"""Textures of what stands and hangs in a house: wood, fabric, rugs, pictures, books, leaves, screens."""

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

VIVID: tuple[Colour, ...] = (
    (178, 58, 52),
    (214, 148, 52),
    (58, 98, 138),
    (72, 122, 92),
    (122, 72, 112),
    (226, 206, 160),
    (48, 62, 82),
    (192, 104, 74),
    (104, 146, 152),
    (232, 224, 208),
)


def wood(rng: np.random.Generator, colour: Colour, *, texels: int = 480) -> Image:
    """Sawn wood with its grain along u."""
    shape = (texels, texels)
    rings = np.sin(14.0 * fractal_noise(shape, rng, falloff=2.0, stretch=9.0))
    fibres = fractal_noise(shape, rng, falloff=0.9, stretch=22.0, coarsest=4.0)
    return as_image(shaded(colour, 0.075 * rings + 0.06 * fibres))


def painted_wood(rng: np.random.Generator, colour: Colour, *, texels: int = 400) -> Image:
    """Brushed paint: faint strokes along u, worn spots."""
    shape = (texels, texels)
    strokes = fractal_noise(shape, rng, falloff=0.9, stretch=16.0, coarsest=4.0)
    worn = np.clip(fractal_noise(shape, rng, falloff=1.5) - 2.0, 0, 1)
    image = shaded(colour, 0.035 * strokes + 0.02 * fractal_noise(shape, rng, falloff=1.8))
    return as_image(blended(image, toned(colour, 0.7), 0.7 * worn))


def cupboard_front(rng: np.random.Generator, colour: Colour, *, doors: int, drawers: int) -> Image:
    """Fronts for one face: framed door panels side by side (or drawers one above the other), with knobs."""
    shape = (400, 400)
    v, u = texel_grid(shape)
    image = shaded(
        colour,
        0.04 * fractal_noise(shape, rng, falloff=0.9, stretch=12.0, coarsest=4.0)
        + 0.02 * fractal_noise(shape, rng, falloff=1.8),
    )
    columns, rows = (doors, 1) if doors else (1, drawers)
    x, y = u * columns % 1.0, v * rows % 1.0
    edge = np.minimum(np.minimum(x, 1 - x) / columns, np.minimum(y, 1 - y) / rows)
    dark, light = toned(colour, 0.4), toned(colour, 1.15)
    image = blended(image, dark, 1.5 - edge * 400 / 2.5)
    frame = 0.055
    image = blended(image, dark, 0.55 * np.exp(-(((edge - frame) / 0.006) ** 2)))
    image = blended(image, light, 0.6 * np.exp(-(((edge - frame - 0.014) / 0.006) ** 2)))
    knob_x = np.where(np.floor(u * columns) % 2 == 0, 0.88, 0.12) if doors else np.full_like(u, 0.5)
    distance = np.hypot((x - knob_x) / columns, (y - 0.5) / rows)
    image = blended(image, (196, 186, 160), (0.02 - distance) * 200)
    return as_image(image)


def fabric(rng: np.random.Generator, colour: Colour, *, texels: int = 320) -> Image:
    """Woven upholstery: threads too fine to count, melange, soft folds."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    threads = np.sin(2 * np.pi * 80 * u) * np.sin(2 * np.pi * 80 * v)
    melange = fractal_noise(shape, rng, falloff=0.6, coarsest=20.0)
    folds = fractal_noise(shape, rng, falloff=2.0)
    return as_image(shaded(colour, 0.03 * threads + 0.05 * melange + 0.05 * folds))


def plaid(
    rng: np.random.Generator, ground: Colour, bands: tuple[Colour, Colour], *, texels: int = 384
) -> Image:
    """Crossing bands in two colours, woven."""
    shape = (texels, texels)
    v, u = texel_grid(shape)
    image = np.broadcast_to(np.asarray(ground, float), (*shape, 3)).copy()
    for coordinate in (u, v):
        phase = coordinate * 4 % 1.0
        image = blended(image, bands[0], 0.5 * np.broadcast_to(np.abs(phase - 0.3) < 0.12, shape))
        image = blended(image, bands[1], 0.6 * np.broadcast_to(np.abs(phase - 0.75) < 0.035, shape))
    return as_image(shaded(image, 0.03 * fractal_noise(shape, rng, falloff=0.8, coarsest=8.0)))


def rug(rng: np.random.Generator, ground: Colour, accents: tuple[Colour, Colour]) -> Image:
    """A knotted rug for one face: borders, a lattice of stepped diamonds, a medallion; pile noise."""
    shape = (400, 600)
    v, u = texel_grid(shape)
    edge = np.minimum(np.minimum(u, 1 - u) * 1.5, np.minimum(v, 1 - v))
    image = np.broadcast_to(np.asarray(ground, float), (*shape, 3)).copy()
    lattice = np.abs((u * 12) % 1.0 - 0.5) + np.abs((v * 8) % 1.0 - 0.5)
    image = blended(image, accents[0], 0.8 * ((lattice > 0.30) & (lattice < 0.42)))
    image = blended(image, accents[1], 0.8 * (lattice < 0.14))
    medallion = np.abs(u - 0.5) * 1.5 + np.abs(v - 0.5)
    for radius, colour in (
        (0.36, accents[1]),
        (0.30, ground),
        (0.24, accents[0]),
        (0.14, ground),
        (0.08, accents[1]),
    ):
        image = blended(image, colour, (radius - medallion) * 120)
    for inner, outer, colour in (
        (0.0, 0.02, accents[1]),
        (0.02, 0.075, accents[0]),
        (0.09, 0.105, accents[1]),
    ):
        image = blended(image, colour, ((edge >= inner) & (edge < outer)).astype(float))
    dots = ((u * 45) % 1.0 < 0.5) & (edge > 0.035) & (edge < 0.06) & ((v * 30) % 1.0 < 0.5)
    image = blended(image, ground, 0.9 * dots)
    pile = 0.05 * fractal_noise(shape, rng, falloff=0.6, coarsest=16.0) + 0.04 * fractal_noise(
        shape, rng, falloff=1.6
    )
    return as_image(shaded(image, pile))


def landscape(rng: np.random.Generator, *, texels: tuple[int, int] = (300, 400)) -> Image:
    """Sky with clouds over three ranges of hills and a meadow: also the view out of a window."""
    v, _ = texel_grid(texels)
    top, low = np.array([96, 150, 206.0]), np.array([212, 226, 236.0])
    image = top + (low - top) * np.clip(v / 0.6, 0, 1)[..., None] + np.zeros((*texels, 3))
    clouds = np.clip(0.9 * fractal_noise(texels, rng, falloff=1.7, stretch=0.5) - 0.1, 0, 1)
    image = blended(image, (250, 250, 248), clouds * np.clip(1.2 - 2 * v, 0, 1))
    ridges: tuple[tuple[float, Colour], ...] = (
        (0.50, (118, 142, 150)),
        (0.60, (92, 124, 92)),
        (0.72, (112, 140, 66)),
    )
    for height, colour in ridges:
        profile = fractal_noise((8, texels[1]), rng, falloff=1.9)[:1]
        line = height + 0.045 * profile
        weight = (v - line) * texels[0]
        image = blended(
            image,
            np.asarray(colour, float) * (1 + 0.12 * fractal_noise(texels, rng, falloff=1.0))[..., None],
            weight,
        )
    return as_image(image)


def abstract_painting(rng: np.random.Generator, *, texels: tuple[int, int] = (300, 400)) -> Image:
    """Flat fields of colour around random sites, with brush strokes and dark outlines."""
    v, u = texel_grid(texels)
    aspect = texels[1] / texels[0]
    sites = rng.random((9, 2)) * [1.0, aspect]
    warp = 0.03 * fractal_noise(texels, rng, falloff=1.8)
    distance = np.stack([np.hypot(v - y + warp, u * aspect - x + warp) for y, x in sites])
    order = np.sort(distance, axis=0)
    colours = np.array(VIVID, float)[rng.permutation(len(VIVID))[:9]]
    strokes = fractal_noise(texels, rng, falloff=1.0, stretch=6.0)
    image = shaded(colours[np.argmin(distance, axis=0)], 0.07 * strokes)
    return as_image(blended(image, (40, 36, 40), 1.4 - (order[1] - order[0]) * texels[0] / 4))


def circles_painting(rng: np.random.Generator, *, texels: tuple[int, int] = (300, 400)) -> Image:
    """Overlapping discs and rings on a pale ground."""
    v, u = texel_grid(texels)
    aspect = texels[1] / texels[0]
    image = shaded((228, 218, 196), 0.03 * fractal_noise(texels, rng, falloff=1.2))
    for _ in range(11):
        y, x = rng.random(2) * [1.0, aspect]
        radius, ring = rng.uniform(0.07, 0.26), rng.random() < 0.4
        away = np.hypot(v - y, u * aspect - x)
        weight = (0.02 - np.abs(away - radius)) * texels[0] if ring else (radius - away) * texels[0]
        image = blended(image, VIVID[rng.integers(len(VIVID))], 0.85 * np.clip(weight, 0, 1))
    return as_image(shaded(image, 0.03 * fractal_noise(texels, rng, falloff=0.9, stretch=3.0)))


def book_spines(rng: np.random.Generator, *, count: int = 24) -> Image:
    """`count` spines side by side: cloth colours, title bands, bars of lettering."""
    spine = 20
    shape = (160, count * spine)
    v, _ = texel_grid(shape)
    image = np.zeros((*shape, 3))
    for k in range(count):
        columns = slice(k * spine, (k + 1) * spine)
        colour = np.asarray(VIVID[rng.integers(len(VIVID))], float) * rng.uniform(0.65, 1.05)
        part = np.broadcast_to(colour, (shape[0], spine, 3)).copy()
        x = (np.arange(spine)[None, :] + 0.5) / spine
        gilt = (226, 200, 130) if colour.mean() < 150 else (70, 54, 48)
        for band in rng.uniform(0.06, 0.94, 3):
            part = blended(
                part, gilt, np.broadcast_to(np.abs(v - band) < 0.012, (shape[0], spine)).astype(float)
            )
        title = rng.uniform(0.25, 0.6)
        letters = (np.abs(v - title) < 0.13) & (np.abs(x - 0.5) < 0.16) & (rng.random((shape[0], 1)) < 0.75)
        part = blended(part, gilt, 0.8 * letters)
        rounding = 1.0 - 0.35 * np.abs(2 * x - 1) ** 3
        image[:, columns] = part * rounding[..., None]
    return as_image(shaded(image, 0.03 * fractal_noise(shape, rng, falloff=0.8)))


def leaf(rng: np.random.Generator, colour: Colour = (74, 122, 58)) -> Image:
    """One leaf per texture: midrib along v, side veins, mottling."""
    shape = (192, 96)
    v, u = texel_grid(shape)
    side = np.abs(u - 0.5)
    vein = np.maximum(
        np.exp(-((side / 0.03) ** 2)), 0.5 * np.exp(-((((v * 9 + side * 5) % 1.0 - 0.5) / 0.08) ** 2))
    )
    image = shaded(colour, 0.12 * fractal_noise(shape, rng, falloff=1.4))
    return as_image(blended(image, (168, 190, 110), 0.6 * vein))


def brushed_metal(rng: np.random.Generator, colour: Colour = (172, 176, 180)) -> Image:
    shape = (256, 256)
    strokes = fractal_noise(shape, rng, falloff=0.8, stretch=30.0, coarsest=4.0)
    return as_image(shaded(colour, 0.045 * strokes + 0.04 * fractal_noise(shape, rng, falloff=1.9)))


def screen(rng: np.random.Generator) -> Image:
    """A television showing a landscape, with a dark bezel and a row of captions."""
    picture = landscape(rng, texels=(270, 480)).astype(float) * 0.8
    v, u = texel_grid((270, 480))
    caption = (v > 0.84) & (v < 0.9) & (u > 0.08) & (u < 0.6) & (np.sin(u * 260) > -0.4)
    picture = blended(picture, (240, 240, 236), 0.85 * caption)
    edge = np.minimum(np.minimum(u, 1 - u) * 480 / 270, np.minimum(v, 1 - v))
    return as_image(blended(picture, (26, 26, 30), (0.03 - edge) * 270))


def oven_front(rng: np.random.Generator) -> Image:
    """A cooker's face: five knobs, a display, a handle, a window with a rack."""
    shape = (300, 300)
    v, u = texel_grid(shape)
    image: Float[ndarray, "h w 3"] = brushed_metal(rng, (186, 188, 190)).astype(float)
    image = np.array(np.asarray(image).repeat(2, axis=0).repeat(2, axis=1)[:300, :300])
    for x in (0.12, 0.26, 0.74, 0.88):
        away = np.hypot(u - x, v - 0.12)
        image = blended(image, (44, 44, 48), (0.05 - away) * 300)
        image = blended(image, (220, 220, 220), (0.035 - away) * 300)
    image = blended(
        image, (24, 34, 38), ((np.abs(u - 0.5) < 0.12) & (np.abs(v - 0.12) < 0.045)).astype(float)
    )
    image = blended(image, (92, 220, 170), 0.9 * ((np.abs(u - 0.5) < 0.06) & (np.abs(v - 0.12) < 0.018)))
    image = blended(image, (60, 60, 64), ((np.abs(u - 0.5) < 0.4) & (np.abs(v - 0.27) < 0.018)).astype(float))
    window = (np.abs(u - 0.5) < 0.36) & (np.abs(v - 0.62) < 0.24)
    image = blended(image, (52, 44, 40), window.astype(float))
    image = blended(image, (140, 132, 122), 0.7 * (window & ((v * 24) % 1.0 < 0.25)))
    return as_image(image)
