"""Seats, beds, tables, shelves and cupboards.

Every piece stands in a frame whose origin is the middle of its back edge on the floor, with x along its width
and y towards whoever uses it; it stays inside `width` x `depth`.
"""

from __future__ import annotations

import numpy as np

from hgs_core.scene.procedural.mesh_builder import MeshBuilder, Surface
from hgs_core.scene.procedural.surfaces import Surfaces


def sofa(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    cloth, half = s["sofa"], width / 2
    b.rounded_box((-half, 0, 0.07), (half, depth, 0.32), 0.04, cloth)
    b.rounded_box((-half, 0, 0.28), (half, 0.24, 0.84), 0.08, cloth)
    for side in (-1, 1):
        x0, x1 = sorted((side * half, side * (half - 0.2)))
        b.rounded_box((x0, 0, 0.28), (x1, depth - 0.02, 0.62), 0.07, cloth)
    seats = 3 if width > 1.8 else 2
    seat_width = (width - 0.4) / seats
    for k in range(seats):
        x0 = -half + 0.2 + k * seat_width
        b.rounded_box((x0 + 0.01, 0.2, 0.3), (x0 + seat_width - 0.01, depth, 0.46), 0.05, cloth)
        b.rounded_box((x0 + 0.03, 0.2, 0.46), (x0 + seat_width - 0.03, 0.38, 0.78), 0.07, cloth)
    for x, name in ((-half + 0.42, "cushion_a"), (half - 0.42, "cushion_b")):
        b.at(x, 0.44, 0.46, rng.uniform(-0.3, 0.3)).rounded_box(
            (-0.2, -0.06, 0), (0.2, 0.07, 0.38), 0.06, s[name]
        )
    _legs(b, (-half + 0.1, half - 0.1), (0.1, depth - 0.1), 0.08, 0.025, s["wood_dark"])


def armchair(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    del rng
    cloth, half = s["armchair"], width / 2
    b.rounded_box((-half, 0.02, 0.12), (half, depth, 0.34), 0.05, cloth)
    b.rounded_box((-half + 0.05, 0, 0.3), (half - 0.05, 0.2, 0.95), 0.08, cloth)
    for side in (-1, 1):
        x0, x1 = sorted((side * half, side * (half - 0.15)))
        b.rounded_box((x0, 0.05, 0.3), (x1, depth - 0.02, 0.58), 0.06, cloth)
    b.rounded_box((-half + 0.16, 0.18, 0.32), (half - 0.16, depth, 0.47), 0.05, s["cushion_b"])
    _legs(b, (-half + 0.08, half - 0.08), (0.1, depth - 0.1), 0.14, 0.02, s["wood_dark"])


def chair(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    """A dining chair; its back is at y = 0."""
    del rng
    wood, half = s["wood_middle"], width / 2
    _legs(b, (-half + 0.025, half - 0.025), (0.03, depth - 0.03), 0.43, 0.02, wood)
    b.rounded_box((-half, 0, 0.42), (half, depth, 0.475), 0.02, s["chair_seat"])
    for x in (-half + 0.025, half - 0.025):
        b.rod((x, 0.03, 0.46), (x, 0.0, 0.92), 0.02, wood)
    b.box((-half, -0.012, 0.80), (half, 0.015, 0.93), wood)
    b.box((-half + 0.03, -0.005, 0.62), (half - 0.03, 0.018, 0.68), wood)


def dining_table(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    """A laid table with chairs on its long sides; `depth` includes the chairs."""
    inset, top = 0.42, 0.74
    x, y0, y1 = width / 2, inset, depth - inset
    b.box((-x, y0, top - 0.04), (x, y1, top), s["wood_dark"])
    b.box((-x + 0.08, y0 + 0.08, top - 0.12), (x - 0.08, y1 - 0.08, top - 0.04), s["wood_dark"], without="Z")
    _legs(b, (-x + 0.09, x - 0.09), (y0 + 0.09, y1 - 0.09), top - 0.05, 0.035, s["wood_dark"], square=True)
    seats = 3 if width > 1.7 else 2
    for k in range(seats):
        at = -x + (k + 0.5) * width / seats
        chair(b.at(at + rng.uniform(-0.03, 0.03), 0.04, 0, rng.uniform(-0.12, 0.12)), s, rng, 0.44, 0.44)
        other = b.at(at + rng.uniform(-0.03, 0.03), depth - 0.04, 0, np.pi + rng.uniform(-0.12, 0.12))
        chair(other, s, rng, 0.44, 0.44)
        for y in (y0 + 0.2, y1 - 0.2):
            b.at(at, y, top).lathe(
                [(0, 0.001), (0.09, 0.004), (0.125, 0.02), (0.1, 0.012), (0, 0.008)], s["ceramic"]
            )
    middle = b.at(0, depth / 2, top)
    middle.box((-0.22 * width, -0.15, 0), (0.22 * width, 0.15, 0.004), s["towel"], without="z")
    middle.lathe(
        [(0.05, 0), (0.14, 0.05), (0.17, 0.1), (0.16, 0.1), (0.12, 0.05), (0, 0.03)], s["terracotta"]
    )
    for k in range(6):
        angle = k * np.pi / 3
        _ball(
            middle.at(0.07 * np.cos(angle), 0.07 * np.sin(angle), 0.1),
            0.045,
            s["wall_accent" if k % 2 else "leaf"],
        )


def coffee_table(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x = width / 2
    b.box((-x, 0, 0.38), (x, depth, 0.42), s["wood_light"])
    b.box((-x + 0.06, 0.06, 0.14), (x - 0.06, depth - 0.06, 0.165), s["wood_light"])
    _legs(b, (-x + 0.05, x - 0.05), (0.05, depth - 0.05), 0.38, 0.03, s["wood_light"], square=True)
    _book_pile(b.at(-0.25 * width, depth / 2, 0.42, 0.3), s, rng, 3)
    _book_pile(b.at(0.15 * width, depth / 2, 0.165, -0.2), s, rng, 4)
    vase(b.at(0.25 * width, depth / 2, 0.42), s, rng, 0.24)


def bed(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x = width / 2
    b.box((-x, 0, 0), (x, 0.07, 1.05), s["wood_middle"], without="z")
    b.box((-x + 0.08, 0.07, 0.35), (x - 0.08, 0.085, 0.97), s["cushion_b"], without="y")
    b.box((-x, 0.07, 0.1), (x, depth, 0.3), s["wood_middle"])
    _legs(b, (-x + 0.06, x - 0.06), (0.15, depth - 0.06), 0.1, 0.035, s["wood_middle"], square=True)
    b.rounded_box((-x + 0.02, 0.08, 0.28), (x - 0.02, depth - 0.02, 0.5), 0.06, s["linen"])
    b.rounded_box((-x - 0.0, 0.75, 0.33), (x + 0.0, depth, 0.54), 0.05, s["blanket"])
    pillows = 2 if width > 1.2 else 1
    for k in range(pillows):
        at = -x + (k + 0.5) * width / pillows
        b.at(at, 0.36, 0.5, rng.uniform(-0.08, 0.08)).rounded_box(
            (-0.32, -0.2, 0), (0.32, 0.2, 0.14), 0.07, s["linen"]
        )
        b.at(at, 0.48, 0.5, rng.uniform(-0.1, 0.1)).rounded_box(
            (-0.2, -0.05, 0.04), (0.2, 0.08, 0.34), 0.06, s["cushion_a"]
        )


def nightstand(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x = width / 2
    b.box((-x, 0, 0.06), (x, depth, 0.5), s["wood_middle"], faces={"Y": s["front_nightstand"]})
    _legs(b, (-x + 0.04, x - 0.04), (0.04, depth - 0.04), 0.06, 0.02, s["wood_dark"])
    table_lamp(b.at(0.0, depth / 2, 0.5), s, rng)


def wardrobe(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x, top = width / 2, 2.05
    b.box(
        (-x, 0, 0.05), (x, depth - 0.02, top), s["wood_middle"], faces={"Y": s["front_wardrobe"]}, without="z"
    )
    b.box((-x + 0.02, 0, 0), (x - 0.02, depth - 0.07, 0.05), s["wood_dark"], without="zZ")
    b.box((-x - 0.0, 0, top), (x + 0.0, depth, top + 0.05), s["wood_middle"])
    for at in (-0.3 * width, 0.2 * width):
        box_height = rng.uniform(0.18, 0.26)
        b.at(at, depth / 2, top + 0.05, rng.uniform(-0.2, 0.2)).box(
            (-0.2, -0.15, 0), (0.2, 0.15, box_height), s["cushion_a" if at < 0 else "paper"], without="z"
        )


def dresser(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x, top = width / 2, 0.84
    b.box((-x, 0, 0.08), (x, depth, top), s["wood_light"], faces={"Y": s["front_drawers"]})
    _legs(b, (-x + 0.05, x - 0.05), (0.05, depth - 0.05), 0.08, 0.025, s["wood_dark"])
    table_lamp(b.at(-0.3 * width, depth / 2, top), s, rng)
    vase(b.at(0.28 * width, depth / 2, top), s, rng, 0.3)
    _book_pile(b.at(0.0, depth / 2, top, 0.1), s, rng, 3)


def sideboard(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x, top = width / 2, 0.78
    for k in range(2):
        x0 = -x + k * x
        b.box(
            (x0, 0, 0.1),
            (x0 + x, depth, top - 0.03),
            s["wood_dark"],
            faces={"Y": s["front_cabinet"]},
            without="Z",
        )
    b.box((-x - 0.0, 0, top - 0.03), (x + 0.0, depth, top), s["wood_dark"])
    _legs(b, (-x + 0.06, x - 0.06), (0.05, depth - 0.06), 0.1, 0.025, s["brass"])
    vase(b.at(-0.3 * width, depth / 2, top), s, rng, 0.34)
    _book_pile(b.at(0.25 * width, depth / 2, top, 0.15), s, rng, 5)
    _picture_stand(b.at(0.0, depth * 0.4, top), s[f"picture_{rng.integers(9)}"], s["wood_light"])


def tv_bench(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x, top = width / 2, 0.5
    b.box((-x, 0, 0.06), (x, depth, 0.09), s["wood_light"])
    b.box((-x, 0, top - 0.03), (x, depth, top), s["wood_light"])
    for at in (-x, -x / 3, x / 3, x - 0.03):
        b.box((at, 0, 0.09), (at + 0.03, depth, top - 0.03), s["wood_light"], without="zZ")
    b.box((-x, 0.0, 0.09), (x, 0.012, top - 0.03), s["wood_light"], without="y")
    b.box(
        (-x / 3 + 0.03, 0, 0.09),
        (x / 3, depth - 0.01, top - 0.03),
        s["wood_dark"],
        faces={"Y": s["front_cabinet"]},
        without="zZ",
    )
    _books(b.at(-x * 2 / 3, 0.04, 0.09), s, rng, x * 2 / 3 - 0.1, 0.26)
    b.box((x / 3 + 0.1, 0.06, 0.09), (x - 0.08, depth - 0.08, 0.17), s["metal_dark"], without="z")
    screen_half = min(0.62, x - 0.1)
    b.box((-0.18, 0.12, top), (0.18, 0.3, top + 0.02), s["metal_dark"], without="z")
    b.box((-0.04, 0.17, top + 0.02), (0.04, 0.21, top + 0.1), s["metal_dark"], without="zZ")
    b.box(
        (-screen_half, 0.16, top + 0.08),
        (screen_half, 0.22, top + 0.08 + screen_half * 1.15),
        s["metal_dark"],
        faces={"Y": s["screen"]},
    )


def bookshelf(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    x, top, board = width / 2, 1.95, 0.025
    wood = s["wood_dark"]
    for at in (-x, x - board):
        b.box((at, 0, 0), (at + board, depth, top), wood, without="z")
    b.box((-x, 0.0, 0.0), (x, 0.012, top), wood, without="yz")
    shelves = 5
    for k in range(shelves + 1):
        z = 0.06 + k * (top - 0.06 - board) / shelves
        b.box((-x + board, 0.012, z), (x - board, depth, z + board), wood, without="xXy")
        if k == shelves:
            break
        room = (top - 0.06 - board) / shelves - board
        inner = width - 2 * board
        if rng.random() < 0.2:
            _books(b.at(-inner / 4, 0.03, z + board), s, rng, inner / 2, room)
            vase(b.at(inner / 4, depth / 2, z + board), s, rng, room * 0.75)
        else:
            _books(b.at(0.0, 0.03, z + board), s, rng, inner * rng.uniform(0.7, 0.98), room)


def desk(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    """A desk with a screen and an office chair before it; `depth` includes the chair."""
    x, top, table = width / 2, 0.74, depth - 0.45
    b.box((-x, 0, top - 0.035), (x, table, top), s["wood_light"])
    b.box(
        (x - 0.42, 0.04, 0.04),
        (x - 0.03, table - 0.04, top - 0.035),
        s["wood_light"],
        faces={"Y": s["front_drawers"]},
        without="Z",
    )
    for y in (0.05, table - 0.05):
        b.rod((-x + 0.05, y, 0), (-x + 0.05, y, top - 0.03), 0.022, s["metal_dark"])
    b.box((-0.13, 0.1, top), (0.13, 0.26, top + 0.015), s["metal_dark"], without="z")
    b.box((-0.025, 0.13, top), (0.025, 0.16, top + 0.14), s["metal_dark"], without="zZ")
    b.box((-0.3, 0.14, top + 0.12), (0.3, 0.18, top + 0.46), s["metal_dark"], faces={"Y": s["picture_0"]})
    b.box((-0.2, 0.36, top), (0.2, 0.49, top + 0.018), s["metal"], without="z")
    _book_pile(b.at(x - 0.25, 0.3, top, 0.2), s, rng, 5)
    table_lamp(b.at(-x + 0.2, 0.2, top), s, rng)
    seat = b.at(rng.uniform(-0.1, 0.1), table - 0.1, 0.0, rng.uniform(-0.4, 0.4) + np.pi)
    office_chair(seat.at(0.0, -0.5), s)


def office_chair(b: MeshBuilder, s: Surfaces) -> None:
    for k in range(5):
        angle = 2 * np.pi * k / 5
        end = (0.25 * np.cos(angle), 0.25 + 0.25 * np.sin(angle), 0.05)
        b.rod((0, 0.25, 0.09), end, 0.022, s["metal_dark"])
        _ball(b.at(end[0], end[1], 0.03), 0.03, s["metal_dark"])
    b.rod((0, 0.25, 0.06), (0, 0.25, 0.44), 0.028, s["metal"])
    b.rounded_box((-0.24, 0.02, 0.43), (0.24, 0.48, 0.52), 0.04, s["chair_seat"])
    b.rounded_box((-0.22, -0.02, 0.58), (0.22, 0.06, 1.02), 0.04, s["chair_seat"])
    b.rod((0, 0.05, 0.45), (0, 0.03, 0.65), 0.02, s["metal_dark"])


def shelf_board(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, height: float) -> None:
    """A wall board with books on it, at `height` above the floor."""
    half = width / 2
    b.box((-half, 0, height), (half, 0.22, height + 0.03), s["wood_middle"], without="y")
    _books(b.at(-0.12 * width, 0.02, height + 0.03), s, rng, 0.6 * width, 0.3)
    vase(b.at(0.36 * width, 0.11, height + 0.03), s, rng, 0.2)


def table_lamp(b: MeshBuilder, s: Surfaces, rng: np.random.Generator) -> None:
    foot = [(0, 0), (0.08, 0), (0.08, 0.015), (0.03, 0.04), (0.055, 0.12), (0.02, 0.2), (0.012, 0.26)]
    b.lathe(foot, s["ceramic" if rng.random() < 0.5 else "terracotta"])
    b.lathe([(0.13, 0.22), (0.085, 0.42)], s["shade"])
    b.lathe([(0.126, 0.22), (0.082, 0.42)], s["shade"])


def floor_lamp(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, depth: float) -> None:
    del rng, width
    lamp = b.at(0.0, depth / 2)
    lamp.lathe([(0, 0.03), (0.15, 0.025), (0.16, 0.0)], s["brass"])
    lamp.rod((0, 0, 0.02), (0, 0, 1.45), 0.014, s["brass"])
    lamp.lathe([(0.22, 1.36), (0.14, 1.68)], s["shade"], segments=24)
    lamp.lathe([(0.216, 1.36), (0.136, 1.68)], s["shade"], segments=24)


def vase(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, height: float) -> None:
    bulge, neck = rng.uniform(0.22, 0.32) * height, rng.uniform(0.1, 0.15) * height
    where = rng.uniform(0.3, 0.5)
    profile = [
        (0, 0),
        (0.6 * bulge, 0),
        (bulge, where * height),
        (neck, 0.85 * height),
        (1.3 * neck, height),
        (0.8 * neck, 0.85 * height),
        (0, 0.8 * height),
    ]
    b.lathe(profile, s[("ceramic", "terracotta", "cushion_b")[rng.integers(3)]])


def _legs(
    b: MeshBuilder,
    x: tuple[float, float],
    y: tuple[float, float],
    height: float,
    radius: float,
    surface: Surface,
    *,
    square: bool = False,
) -> None:
    for at_x in x:
        for at_y in y:
            if square:
                b.box(
                    (at_x - radius, at_y - radius, 0),
                    (at_x + radius, at_y + radius, height),
                    surface,
                    without="zZ",
                )
            else:
                b.rod((at_x, at_y, 0), (at_x, at_y, height), radius, surface)


def _ball(b: MeshBuilder, radius: float, surface: Surface) -> None:
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
    b.lathe([(radius * float(np.cos(a)), radius * float(np.sin(a))) for a in angle], surface, segments=12)


def _books(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, width: float, room: float) -> None:
    """A row of upright books, `width` long, backs towards +y, in a shelf `room` high."""
    at = -width / 2
    while at < width / 2 - 0.02:
        thick = min(rng.uniform(0.02, 0.055), width / 2 - at)
        high, deep = room * rng.uniform(0.6, 0.92), rng.uniform(0.14, 0.19)
        _book(b, s, rng, (at, 0, 0), (at + thick, deep, high))
        at += thick + 0.001


def _book(
    b: MeshBuilder,
    s: Surfaces,
    rng: np.random.Generator,
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
) -> None:
    spines = s[f"spines_{rng.integers(3)}"]
    k = int(rng.integers(24))
    u0, u1 = k / 24, (k + 1) / 24
    (x0, y0, z0), (x1, y1, z1) = lower, upper
    back = np.array([[[x1, y1, z0], [x0, y1, z0]], [[x1, y1, z1], [x0, y1, z1]]])
    b.sheet(back, np.array([[[u0, 0], [u1, 0]], [[u0, 1], [u1, 1]]], dtype=float), spines)
    plain = (u0 + u1) / 2
    for x in (x0, x1):
        cover = np.array([[[x, y0, z0], [x, y1, z0]], [[x, y0, z1], [x, y1, z1]]])
        b.sheet(cover, np.array([[[plain, 0.02], [plain, 0.02]], [[plain, 0.98], [plain, 0.98]]]), spines)
    b.box(lower, upper, s["paper"], without="xXYyz")


def _book_pile(b: MeshBuilder, s: Surfaces, rng: np.random.Generator, count: int) -> None:
    z = 0.0
    for _ in range(count):
        thick = float(rng.uniform(0.02, 0.045))
        size_x, size_y = rng.uniform(0.09, 0.12), rng.uniform(0.065, 0.085)
        book = b.at(0, 0, z, rng.uniform(-0.25, 0.25))
        book.box((-size_x, -size_y, 0), (size_x, size_y, thick), s["paper"], without="zZ")
        cover = s[("cushion_a", "sofa", "terracotta", "blanket", "chair_seat")[rng.integers(5)]]
        book.box(
            (-size_x - 0.004, -size_y - 0.004, thick - 0.004), (size_x + 0.004, size_y + 0.004, thick), cover
        )
        z += thick
    del z


def _picture_stand(b: MeshBuilder, picture: Surface, frame: Surface) -> None:
    b.box((-0.14, -0.015, 0), (0.14, 0.0, 0.22), frame, without="z")
    b.quad([(0.12, 0.001, 0.02), (-0.12, 0.001, 0.02), (-0.12, 0.001, 0.2), (0.12, 0.001, 0.2)], picture)
