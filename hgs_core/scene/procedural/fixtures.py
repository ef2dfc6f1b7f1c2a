"""Kitchen and bathroom fittings, plants, pictures, rugs and lights. Frames are as in `furniture`."""

from __future__ import annotations

import numpy as np

from hgs_core.scene.procedural.mesh_builder import MeshBuilder, Surface
from hgs_core.scene.procedural.surfaces import Surfaces

_COUNTER_M = 0.9


def kitchen_counter(
    b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float
) -> None:
    """Base units with a cooker, a sink, things on the worktop and a tiled wall behind it."""
    units = max(2, round(width / 0.6))
    cooker, sink = (int(k) for k in rng.choice(units, size=2, replace=False))
    _base_units(b, s, rng, width, depth, cooker=cooker, sink=sink)


def worktop(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    """Base units without cooker or sink."""
    _base_units(b, s, rng, width, depth, cooker=None, sink=None)


def _base_units(
    b: MeshBuilder,
    s: Surfaces,
    rng: np.random.Generator,
    width: float,
    depth: float,
    *,
    cooker: int | None,
    sink: int | None,
) -> None:
    half = width / 2
    units = max(2, round(width / 0.6))
    unit = width / units
    b.box((-half, 0, 0), (half, depth - 0.07, 0.1), s["wood_dark"], without="zZy")
    for k in range(units):
        x0 = -half + k * unit
        front = s["oven" if k == cooker else ("front_kitchen_drawers" if k % 3 == 2 else "front_kitchen")]
        hidden = "yzZ" + ("" if k == 0 else "x") + ("" if k == units - 1 else "X")
        b.box(
            (x0, 0, 0.1),
            (x0 + unit, depth - 0.03, _COUNTER_M - 0.035),
            s["paint_kitchen"],
            faces={"Y": front},
            without=hidden,
        )
    b.box((-half, 0, _COUNTER_M - 0.035), (half, depth, _COUNTER_M), s["worktop"], without="y")
    b.box((-half, 0, _COUNTER_M), (half, 0.012, _COUNTER_M + 0.5), s["backsplash"], without="yz")
    if cooker is not None:
        _hob(b.at(-half + (cooker + 0.5) * unit, depth / 2, _COUNTER_M), s)
    if sink is not None:
        _sink(b.at(-half + (sink + 0.5) * unit, depth / 2, _COUNTER_M), s)
    for k in range(units):
        if k not in (cooker, sink):
            _on_worktop(b.at(-half + (k + 0.5) * unit, depth * 0.4, _COUNTER_M), s, int(rng.integers(3)))


def _hob(hob: MeshBuilder, s: Surfaces) -> None:
    hob.box((-0.26, -0.22, 0), (0.26, 0.22, 0.008), s["metal_dark"], without="z")
    for x, y in ((-0.13, -0.1), (0.13, -0.1), (-0.13, 0.1), (0.13, 0.1)):
        hob.at(x, y, 0.008).lathe([(0.08, 0), (0.08, 0.02), (0.06, 0.02), (0.06, 0.0)], s["metal"])
    pot(hob.at(0.13, -0.1, 0.028), s)


def _sink(basin: MeshBuilder, s: Surfaces) -> None:
    basin.box((-0.25, -0.2, 0.0), (0.25, 0.2, 0.012), s["metal"], without="z")
    basin.box((-0.2, -0.15, 0.012), (0.2, 0.15, 0.0125), s["metal_dark"], without="zxXyY")
    basin.rod((0, -0.24, 0), (0, -0.24, 0.28), 0.016, s["metal"])
    basin.rod((0, -0.24, 0.28), (0, -0.06, 0.24), 0.014, s["metal"])


def _on_worktop(spot: MeshBuilder, s: Surfaces, kind: int) -> None:
    """A toaster, a row of jars, or a board with a pot."""
    if kind == 0:
        spot.box((-0.17, -0.11, 0), (0.17, 0.11, 0.2), s["metal"], without="z")
        spot.box((-0.12, 0.111, 0.05), (0.12, 0.112, 0.16), s["metal_dark"], without="zy")
    elif kind == 1:
        for j, height in enumerate((0.22, 0.18, 0.14)):
            jar = spot.at(-0.14 + 0.14 * j, 0)
            jar.cylinder(0.055, 0, height, s["terracotta"])
            jar.cylinder(0.058, height, height + 0.02, s["wood_light"])
    else:
        spot.box((-0.18, -0.02, 0), (0.18, 0.0, 0.28), s["wood_light"], without="z")
        pot(spot.at(0.05, 0.12), s)


def wall_cupboards(b: MeshBuilder, s: Surfaces, width: float) -> None:
    """Units on the wall above a counter, from 1.45 m up."""
    units = max(1, round(width / 0.6))
    for k in range(units):
        x0 = -width / 2 + k * width / units
        hidden = "y" + ("" if k == 0 else "x") + ("" if k == units - 1 else "X")
        b.box(
            (x0, 0, 1.45),
            (x0 + width / units, 0.34, 2.15),
            s["paint_kitchen"],
            faces={"Y": s["front_kitchen"]},
            without=hidden,
        )


def fridge(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x = width / 2
    b.box((-x, 0, 0.03), (x, depth - 0.05, 1.78), s["metal"], without="z")
    b.box((-x, depth - 0.05, 0.05), (x, depth - 0.02, 0.64), s["metal"], without="y")
    b.box((-x, depth - 0.05, 0.66), (x, depth - 0.02, 1.76), s["metal"], without="y")
    for z0, z1 in ((0.3, 0.58), (0.75, 1.15)):
        b.rod((x - 0.07, depth - 0.005, z0), (x - 0.07, depth - 0.005, z1), 0.012, s["metal_dark"])
    for _ in range(5):
        px, pz = rng.uniform(-x + 0.06, x - 0.24), rng.uniform(0.8, 1.55)
        size = rng.uniform(0.08, 0.15)
        y = depth - 0.019
        picture = s[f"picture_{rng.integers(9)}"]
        b.quad([(px + size, y, pz), (px, y, pz), (px, y, pz + size), (px + size, y, pz + size)], picture)


def bathtub(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    del rng
    x, top, rim = width / 2, 0.56, 0.07
    b.box((-x, 0, 0), (x, depth, top), s["ceramic"], without="zZ")
    bottom = 0.16
    outer = [(-x, 0.0), (x, 0.0), (x, depth), (-x, depth)]
    inner = [(-x + rim, rim), (x - rim, rim), (x - rim, depth - rim), (-x + rim, depth - rim)]
    low = [
        (-x + 0.2, rim + 0.08),
        (x - 0.14, rim + 0.08),
        (x - 0.14, depth - rim - 0.08),
        (-x + 0.2, depth - rim - 0.08),
    ]
    for k in range(4):
        j = (k + 1) % 4
        b.quad([(*outer[k], top), (*outer[j], top), (*inner[j], top), (*inner[k], top)], s["ceramic"])
        b.quad([(*inner[k], top), (*inner[j], top), (*low[j], bottom), (*low[k], bottom)], s["ceramic"])
    b.quad([(*low[0], bottom), (*low[1], bottom), (*low[2], bottom), (*low[3], bottom)], s["ceramic"])
    b.rod((x - 0.02, depth / 2, 0.72), (x - 0.2, depth / 2, 0.7), 0.02, s["metal"])
    b.box((-0.3, depth + 0.0, 0.2), (0.05, depth + 0.015, top + 0.01), s["towel"], without="y")


def toilet(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    del rng
    x = width / 2
    b.rounded_box((-x, 0, 0.38), (x, 0.18, 0.8), 0.03, s["ceramic"])
    bowl = b.at(0, depth - 0.25)
    bowl.lathe([(0.11, 0), (0.11, 0.12), (0.19, 0.36), (0.2, 0.4)], s["ceramic"], segments=24)
    bowl.lathe([(0.0, 0.43), (0.2, 0.43), (0.205, 0.4)], s["paint_white"], segments=24)
    b.box((-0.1, 0.12, 0), (0.1, depth - 0.25, 0.38), s["ceramic"], without="z")


def washstand(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    del rng
    x, top = width / 2, 0.82
    b.box((-x, 0, 0.12), (x, depth, top), s["wood_light"], faces={"Y": s["front_cabinet"]}, without="Z")
    b.box((-x, 0, top), (x, depth, top + 0.03), s["marble"], without="z")
    b.at(0, depth / 2, top + 0.03).lathe(
        [(0.12, 0), (0.2, 0.1), (0.21, 0.12), (0.19, 0.12), (0.1, 0.02), (0, 0.015)],
        s["ceramic"],
        segments=24,
    )
    b.rod((0, 0.05, top + 0.03), (0, 0.05, top + 0.24), 0.016, s["metal"])
    b.rod((0, 0.05, top + 0.24), (0, 0.17, top + 0.22), 0.014, s["metal"])
    b.box((-x * 0.8, 0, 1.2), (x * 0.8, 0.03, 1.9), s["wood_light"], faces={"Y": s["mirror"]}, without="y")
    for at in (-0.7, 0.72):
        b.at(at * x, 0.12, top + 0.03).cylinder(0.03, 0, 0.15, s["cushion_a"])


def towel_rail(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    del rng, depth
    x = width / 2
    for z in (0.6, 0.9, 1.2, 1.5):
        b.rod((-x, 0.06, z), (x, 0.06, z), 0.014, s["metal"])
    for at in (-x, x):
        b.rod((at, 0.06, 0.45), (at, 0.06, 1.6), 0.018, s["metal"])
    b.box((-x + 0.05, 0.04, 0.85), (x - 0.08, 0.09, 1.52), s["towel"])


def coat_rack(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    """Hooks with coats over a shoe bench."""
    x = width / 2
    b.box((-x, 0, 1.55), (x, 0.025, 1.7), s["wood_middle"], without="y")
    cloths = ("sofa", "cushion_b", "armchair", "chair_seat")
    hooks = max(2, int(width / 0.28))
    for k in range(hooks):
        at = -x + (k + 0.5) * width / hooks
        b.rod((at, 0.02, 1.6), (at, 0.09, 1.63), 0.01, s["brass"])
        if rng.random() < 0.7:
            length = rng.uniform(0.6, 0.9)
            b.rounded_box(
                (at - 0.12, 0.03, 1.6 - length), (at + 0.12, 0.15, 1.6), 0.05, s[cloths[rng.integers(4)]]
            )
    b.box((-x, 0, 0.36), (x, depth, 0.4), s["wood_middle"], without="y")
    for at in (-x, x - 0.03):
        b.box((at, 0, 0), (at + 0.03, depth, 0.36), s["wood_middle"], without="zZ")
    for k in range(int(width / 0.26)):
        at = -x + 0.16 + k * 0.26
        for dx in (-0.055, 0.055):
            b.at(at + dx, depth / 2).rounded_box(
                (-0.045, -0.12, 0.0), (0.045, 0.13, 0.09), 0.04, s["soil" if k % 2 else "terracotta"]
            )


def plant(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    """A potted plant of broad arching leaves, 1.1 to 1.5 m high."""
    root = b.at(0.0, depth / 2)
    radius = 0.42 * min(width, depth)
    root.lathe(
        [
            (0, 0),
            (0.6 * radius, 0),
            (0.85 * radius, 0.3),
            (0.95 * radius, 0.33),
            (0.8 * radius, 0.33),
            (0.78 * radius, 0.28),
        ],
        s["terracotta"],
    )
    root.lathe([(0.78 * radius, 0.28), (0.0, 0.3)], s["soil"])
    height = rng.uniform(0.8, 1.1)
    for k in range(18):
        angle, rise = k * 2.4 + rng.uniform(-0.2, 0.2), rng.uniform(0.55, 1.0)
        reach = min(width, depth) * 0.5 * rng.uniform(0.75, 1.0)
        t = np.linspace(0, 1, 6)
        out, up = (
            reach * t**1.3,
            0.3 + height * rise * np.sin(0.85 * np.pi * t * 0.75) / np.sin(0.85 * np.pi * 0.5),
        )
        half = 0.06 * np.sin(np.pi * np.clip(t, 0.04, 0.98)) ** 0.7
        points = np.empty((6, 3, 3))
        for j, side in enumerate((-1.0, 0.0, 1.0)):
            points[:, j, 0] = out * np.cos(angle) - side * half * np.sin(angle)
            points[:, j, 1] = out * np.sin(angle) + side * half * np.cos(angle)
            points[:, j, 2] = up - 0.02 * abs(side)
        u, v = np.meshgrid([0.0, 0.5, 1.0], t)
        root.sheet(points, np.stack([u, v], axis=-1), s["leaf"])


def pot(b: MeshBuilder, s: Surfaces) -> None:
    b.lathe(
        [(0, 0), (0.1, 0), (0.105, 0.11), (0.1, 0.115), (0.02, 0.13), (0.02, 0.15), (0, 0.155)], s["metal"]
    )
    b.rod((0.1, 0, 0.09), (0.2, 0, 0.1), 0.012, s["metal_dark"])


def rug(b: MeshBuilder, surface: Surface, edge: Surface, size: tuple[float, float]) -> None:
    """A rug centred on the frame, 1.2 cm thick: wheels roll over it."""
    x, y = size[0] / 2, size[1] / 2
    if y > x:
        rug(b.at(0, 0, 0, np.pi / 2), surface, edge, (size[1], size[0]))
        return
    b.box((-x, -y, 0), (x, y, 0.012), edge, faces={"Z": surface}, without="z")


def picture(
    b: MeshBuilder, s: Surfaces, surface: Surface, width: float, height: float, middle_z: float
) -> None:
    """A framed picture on the wall."""
    x, z0, z1, bar = width / 2, middle_z - height / 2, middle_z + height / 2, 0.045
    frame = s["wood_dark" if width > 0.7 else "brass"]
    b.quad([(x, 0.012, z0), (-x, 0.012, z0), (-x, 0.012, z1), (x, 0.012, z1)], surface)
    for x0, x1, low, high in (
        (-x - bar, -x, z0 - bar, z1 + bar),
        (x, x + bar, z0 - bar, z1 + bar),
        (-x, x, z0 - bar, z0),
        (-x, x, z1, z1 + bar),
    ):
        b.box((x0, 0, low), (x1, 0.03, high), frame, without="y")


def pendant(b: MeshBuilder, s: Surfaces, ceiling_m: float) -> None:
    """A hanging lamp, its shade from 1.95 m up."""
    b.lathe([(0.06, ceiling_m), (0.06, ceiling_m - 0.03), (0, ceiling_m - 0.035)], s["brass"])
    b.rod((0, 0, 2.2), (0, 0, ceiling_m), 0.008, s["metal_dark"])
    b.lathe(
        [(0.03, 2.24), (0.1, 2.2), (0.24, 1.98), (0.235, 1.98), (0.09, 2.19), (0.0, 2.2)],
        s["shade"],
        segments=28,
    )
