"""Floors, walls, ceilings, doorways and windows of a layout."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgs_core.scene.procedural.layout import CEILING_M, DOOR_HEIGHT_M, Doorway, Layout, Role, Room, Window
from hgs_core.scene.procedural.mesh_builder import MeshBuilder, Surface
from hgs_core.scene.procedural.surfaces import N_VIEWS, Surfaces

_BASEBOARD_M = (0.012, 0.09)
_CASING_M = 0.07
_RAIL_M = {Role.HALL: 0.8, Role.BATH: 2.0}
"""Height up to which a room's walls have a second surface, under a rail."""

_WALL = {
    Role.LIVING: ("wall_living", "wall_living"),
    Role.KITCHEN: ("wall_kitchen", "wall_kitchen"),
    Role.BEDROOM: ("wall_bedroom", "wall_bedroom"),
    Role.STUDY: ("wall_study", "wall_study"),
    Role.BATH: ("wall_bath", "wall_upper"),
    Role.HALL: ("panelling", "wall_hall"),
}


def wall_frame(builder: MeshBuilder, room: Room, side: str, along: float) -> MeshBuilder:
    """A frame on the wall at `along`: x along the wall, y into the room, z up."""
    x, y, yaw = {
        "y": (along, room.y[0], 0.0),
        "Y": (along, room.y[1], np.pi),
        "x": (room.x[0], along, -np.pi / 2),
        "X": (room.x[1], along, np.pi / 2),
    }[side]
    return builder.at(x, y, 0.0, yaw)


def build_shell(builder: MeshBuilder, layout: Layout, surfaces: Surfaces) -> None:
    for number, room in enumerate(layout.rooms):
        _floor_and_ceiling(builder, room, surfaces)
        for side in "xXyY":
            _wall(builder, layout, number, side, surfaces)
    for doorway in layout.doorways:
        _doorway(builder, doorway, surfaces)
    for number, window in enumerate(layout.windows):
        room = layout.rooms[window.room]
        frame = wall_frame(builder, room, window.side, sum(window.along) / 2)
        _window(
            frame, window, surfaces, surfaces[f"view_{number % N_VIEWS}"], curtains=room.role != Role.BATH
        )


def openings(layout: Layout, number: int, side: str) -> list[tuple[float, float]]:
    """Where doorways cut the wall on `side` of room `number`, in order along it."""
    room = layout.rooms[number]
    middle = sum(room.x if side in "xX" else room.y) / 2
    found = []
    for doorway in layout.doorways:
        if number not in doorway.rooms or doorway.across_x != (side in "xX"):
            continue
        beyond = sum(doorway.x if doorway.across_x else doorway.y) / 2 > middle
        if beyond == (side in "XY"):
            found.append(doorway.along)
    return sorted(found)


def _floor_and_ceiling(builder: MeshBuilder, room: Room, surfaces: Surfaces) -> None:
    (x0, x1), (y0, y1) = room.x, room.y
    floor = surfaces[f"floor_{room.role}"]
    builder.quad([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)], floor, (x0, y0))
    z = CEILING_M
    builder.quad([(x0, y1, z), (x1, y1, z), (x1, y0, z), (x0, y0, z)], surfaces["ceiling"], (x0, y0))


def _wall(builder: MeshBuilder, layout: Layout, number: int, side: str, surfaces: Surfaces) -> None:
    room = layout.rooms[number]
    extent = room.y if side in "xX" else room.x
    lower_name, upper_name = _WALL[room.role]
    if room.role == Role.LIVING and not openings(layout, number, side) and side in "xX":
        lower_name = upper_name = "wall_accent"
    rail = _RAIL_M.get(room.role)
    bands = (
        [(0.0, rail, lower_name), (rail, CEILING_M, upper_name)] if rail else [(0.0, CEILING_M, upper_name)]
    )
    frame = wall_frame(builder, room, side, 0.0)
    # The local x axis of a wall seen from its room runs against the world's on two of the four sides.
    sign = 1.0 if side in "yX" else -1.0
    cuts = openings(layout, number, side)
    for begin, end, is_opening in _pieces(extent, cuts):
        low, high = sorted((sign * begin, sign * end))
        for z0, z1, name in bands:
            bottom = max(z0, DOOR_HEIGHT_M) if is_opening else z0
            if bottom < z1:
                _panel(frame, (low, high), (bottom, z1), surfaces[name])
        if not is_opening:
            left = low + (_CASING_M if _touches(sign * low, cuts) else 0.0)
            right = high - (_CASING_M if _touches(sign * high, cuts) else 0.0)
            thickness, height = _BASEBOARD_M
            frame.box((left, 0, 0), (right, thickness, height), surfaces["trim"], without="zy")
            if rail:
                frame.box((left, 0, rail - 0.03), (right, 0.018, rail + 0.03), surfaces["trim"], without="y")
    frame.box(
        (min(sign * extent[0], sign * extent[1]), 0, CEILING_M - 0.07),
        (max(sign * extent[0], sign * extent[1]), 0.05, CEILING_M),
        surfaces["trim"],
        without="yZ",
    )


def _pieces(
    extent: tuple[float, float], cuts: list[tuple[float, float]]
) -> Iterator[tuple[float, float, bool]]:
    """The wall from end to end as (begin, end, is an opening)."""
    at = extent[0]
    for begin, end in cuts:
        if begin > at:
            yield at, begin, False
        yield begin, end, True
        at = end
    if at < extent[1]:
        yield at, extent[1], False


def _touches(position: float, cuts: list[tuple[float, float]]) -> bool:
    return any(min(abs(position - begin), abs(position - end)) < 1e-6 for begin, end in cuts)


def _panel(frame: MeshBuilder, x: tuple[float, float], z: tuple[float, float], surface: Surface) -> None:
    """A piece of wall; the texture runs on from piece to piece."""
    # Seen from the room (looking against local +y), right is local -x.
    points = np.array([[[x[1], 0, z[0]], [x[0], 0, z[0]]], [[x[1], 0, z[1]], [x[0], 0, z[1]]]], dtype=float)
    uv = np.array([[[-x[1], z[0]], [-x[0], z[0]]], [[-x[1], z[1]], [-x[0], z[1]]]], dtype=float)
    frame.sheet(points, uv, surface)


def _doorway(builder: MeshBuilder, doorway: Doorway, surfaces: Surfaces) -> None:
    """Threshold, jambs and lintel through the wall, and a casing around the opening on either side."""
    along, across = doorway.along, doorway.x if doorway.across_x else doorway.y
    middle = sum(along) / 2
    half, depth = (along[1] - along[0]) / 2, across[1] - across[0]
    # Local frame: x along the wall, y through it.
    if doorway.across_x:
        frame = builder.at(across[1], middle, 0.0, np.pi / 2)
    else:
        frame = builder.at(middle, across[0], 0.0, 0.0)
    top, trim = DOOR_HEIGHT_M, surfaces["trim"]
    frame.quad([(-half, 0, 0), (half, 0, 0), (half, depth, 0), (-half, depth, 0)], surfaces["threshold"])
    frame.quad([(-half, 0, 0), (-half, depth, 0), (-half, depth, top), (-half, 0, top)], trim)
    frame.quad([(half, depth, 0), (half, 0, 0), (half, 0, top), (half, depth, top)], trim)
    frame.quad([(-half, 0, top), (-half, depth, top), (half, depth, top), (half, 0, top)], trim)
    for y0, y1, hidden in ((-0.016, 0.0, "Y"), (depth, depth + 0.016, "y")):
        frame.box((-half - _CASING_M, y0, 0), (-half, y1, top), trim, without="zZ" + hidden)
        frame.box((half, y0, 0), (half + _CASING_M, y1, top), trim, without="zZ" + hidden)
        frame.box((-half - _CASING_M, y0, top), (half + _CASING_M, y1, top + _CASING_M), trim, without=hidden)


def _window(frame: MeshBuilder, window: Window, surfaces: Surfaces, view: Surface, *, curtains: bool) -> None:
    """A framed view with a cross bar and a sill, and curtains at its sides."""
    half = (window.along[1] - window.along[0]) / 2
    z0, z1 = window.z
    trim = surfaces["trim"]
    frame.quad([(half, 0.012, z0), (-half, 0.012, z0), (-half, 0.012, z1), (half, 0.012, z1)], view)
    bar = 0.06
    for x0, x1, low, high in (
        (-half - bar, -half, z0 - bar, z1 + bar),
        (half, half + bar, z0 - bar, z1 + bar),
        (-half, half, z0 - bar, z0),
        (-half, half, z1, z1 + bar),
        (-0.02, 0.02, z0, z1),
        (-half, half, (z0 + z1) / 2 + 0.16, (z0 + z1) / 2 + 0.19),
    ):
        frame.box((x0, 0, low), (x1, 0.045, high), trim, without="y")
    frame.box((-half - 0.1, 0, z0 - bar - 0.03), (half + 0.1, 0.14, z0 - bar), trim, without="y")
    if not curtains:
        return
    rail_z, width = z1 + 0.2, 0.32
    for side in (-1.0, 1.0):
        begin = side * (half + 0.10 + width) if side < 0 else half + 0.10
        across = np.linspace(0, width, 25)
        wave = 0.075 + 0.022 * np.sin(across / width * 2 * np.pi * 4)
        heights = np.linspace(z0 - 0.28, rail_z, 4)
        points = np.empty((4, 25, 3))
        points[..., 0] = begin + across
        points[..., 1] = wave
        points[..., 2] = heights[:, None]
        u, v = np.meshgrid(across, heights)
        frame.sheet(points, np.stack([u, v], axis=-1), surfaces["curtain"])
    frame.rod((-half - 0.46, 0.075, rail_z), (half + 0.46, 0.075, rail_z), 0.014, surfaces["brass"])
