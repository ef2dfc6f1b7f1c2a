"""The plans of a house and of an office floor: rooms, doorways and windows, drawn by seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

CEILING_M = 2.6
DOOR_HEIGHT_M = 2.06
WALL_M = 0.14


class Role(StrEnum):
    LIVING = "living"
    KITCHEN = "kitchen"
    BEDROOM = "bedroom"
    STUDY = "study"
    BATH = "bath"
    HALL = "hall"


@dataclass(frozen=True, kw_only=True)
class Room:
    """A rectangular room: its clear floor, walls not included [m]."""

    role: Role
    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def area_m2(self) -> float:
        return (self.x[1] - self.x[0]) * (self.y[1] - self.y[0])


@dataclass(frozen=True, kw_only=True)
class Doorway:
    """An opening between two rooms: `x` and `y` span the block of wall that is cut out [m].

    `across_x`: one walks through it along x.
    """

    rooms: tuple[int, int]
    x: tuple[float, float]
    y: tuple[float, float]
    across_x: bool

    @property
    def along(self) -> tuple[float, float]:
        """The opening's extent along the wall."""
        return self.y if self.across_x else self.x


@dataclass(frozen=True, kw_only=True)
class Window:
    """A window in `side` ("x", "X", "y" or "Y": lower or upper) of a room."""

    room: int
    side: str
    along: tuple[float, float]
    z: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Rooms around a hall; coordinates are centred on the house."""

    rooms: tuple[Room, ...]
    doorways: tuple[Doorway, ...]
    windows: tuple[Window, ...]

    @property
    def area_m2(self) -> float:
        return sum(room.area_m2 for room in self.rooms)


def draw_layout(rng: np.random.Generator) -> Layout:
    """A living room over the house's whole depth, a hall beside it, and three or four rooms along the hall.

    Clear floor is 80 to 105 m2; doorways are 1.0 m wide, openings to the living room 1.3 to 1.6 m. The plan
    is mirrored at random in x and y.
    """
    width, depth = rng.uniform(11.0, 12.0), rng.uniform(8.4, 9.2)
    living_x = rng.uniform(4.3, 4.8)
    hall_y = (depth / 2 - 0.8 + rng.uniform(-0.25, 0.25), 0.0)
    hall_y = (hall_y[0], hall_y[0] + rng.uniform(1.5, 1.7))
    begin = living_x + WALL_M
    lower_y, upper_y = (0.0, hall_y[0] - WALL_M), (hall_y[1] + WALL_M, depth)
    upper_split = begin + (width - begin) * rng.uniform(0.54, 0.6)
    lower_split = begin + (width - begin) * rng.uniform(0.5, 0.56)
    rooms = [
        Room(role=Role.LIVING, x=(0.0, living_x), y=(0.0, depth)),
        Room(role=Role.HALL, x=(begin, width), y=hall_y),
        Room(role=Role.KITCHEN, x=(begin, upper_split), y=upper_y),
        Room(role=Role.BATH, x=(upper_split + WALL_M, width), y=upper_y),
    ]
    if rng.random() > 0.25:
        rooms += [
            Room(role=Role.BEDROOM, x=(lower_split + WALL_M, width), y=lower_y),
            Room(role=Role.STUDY, x=(begin, lower_split), y=lower_y),
        ]
    else:
        rooms.append(Room(role=Role.BEDROOM, x=(begin, width), y=lower_y))
    doorways = [
        _between_x(0, 1, living_x, (hall_y[0] + 0.1, hall_y[1] - 0.1)),
        _between_x(0, 2, living_x, _span(upper_y, rng.uniform(0.3, 0.7), 1.4)),
    ]
    for number, room in enumerate(rooms[2:], start=2):
        wall_y = hall_y[1] if room.y[0] > hall_y[1] else hall_y[0] - WALL_M
        along = _span(room.x, rng.uniform(0.2, 0.8), 1.0)
        doorways.append(Doorway(rooms=(1, number), x=along, y=(wall_y, wall_y + WALL_M), across_x=False))
    layout = Layout(
        rooms=tuple(rooms), doorways=tuple(doorways), windows=windows_of(rooms, width, depth, rng)
    )
    layout = centred(layout, width, depth)
    if rng.random() < 0.5:
        layout = _mirrored_x(layout)
    if rng.random() < 0.5:
        layout = _mirrored_y(layout)
    return layout


def draw_building(rng: np.random.Generator) -> Layout:
    """A floor of an office building: two long corridors with rooms on both sides, joined by two passages.

    Clear floor is 1000 to 1300 m2; doorways are 1.0 m wide, openings of the corridors 1.8 m.
    """
    length = rng.uniform(44.0, 47.0)
    depths = rng.uniform(5.2, 5.9, 4).tolist()
    corridors = rng.uniform(2.3, 2.7, 2).tolist()
    rows, halls, at = [], [], 0.0
    for number, depth in enumerate(depths):
        rows.append((at, at + depth))
        at += depth + WALL_M
        if number in (0, 2):
            halls.append((at, at + corridors[number // 2]))
            at += corridors[number // 2] + WALL_M
    rooms = [Room(role=Role.HALL, x=(0.0, length), y=hall) for hall in halls]
    doorways = []
    # The passages take the place of rooms in both inner rows.
    passages = [
        (where * length, where * length + 2.0) for where in rng.uniform([0.2, 0.65], [0.35, 0.8]).tolist()
    ]
    for passage in passages:
        number = len(rooms)
        rooms.append(Room(role=Role.HALL, x=passage, y=(rows[1][0], rows[2][1])))
        along = _span(passage, 0.5, 1.4)
        for hall, wall_y in ((0, rows[1][0] - WALL_M), (1, rows[2][1])):
            doorways.append(
                Doorway(rooms=(hall, number), x=along, y=(wall_y, wall_y + WALL_M), across_x=False)
            )
    inner = [0.0, *(edge for a, b in passages for edge in (a - WALL_M, b + WALL_M)), length]
    for row, span in enumerate(rows):
        stretches = [(0.0, length)] if row in (0, 3) else list(zip(inner[::2], inner[1::2], strict=True))
        hall = row // 2
        wall_y = rows[row][1] if row in (0, 2) else rows[row][0] - WALL_M
        for stretch in stretches:
            for room_x in _cut(stretch, rng):
                doorways.append(
                    Doorway(
                        rooms=(hall, len(rooms)),
                        x=_span(room_x, rng.uniform(0.2, 0.8), 1.0),
                        y=(wall_y, wall_y + WALL_M),
                        across_x=False,
                    )
                )
                rooms.append(Room(role=_role(room_x[1] - room_x[0], rng), x=room_x, y=span))
    depth = rows[-1][1]
    layout = Layout(
        rooms=tuple(rooms), doorways=tuple(doorways), windows=windows_of(rooms, length, depth, rng)
    )
    return centred(layout, length, depth)


def _cut(stretch: tuple[float, float], rng: np.random.Generator) -> list[tuple[float, float]]:
    """Rooms side by side, 2.6 to 7.5 m wide, with walls between them."""
    length = stretch[1] - stretch[0] + WALL_M
    count = max(1, round(length / rng.uniform(4.6, 5.6)))
    edges = np.linspace(0.0, length, count + 1)
    edges[1:-1] += rng.uniform(-0.18, 0.18, count - 1) * (length / count)
    lows, highs = stretch[0] + edges[:-1], stretch[0] + edges[1:] - WALL_M
    return [(float(low), float(high)) for low, high in zip(lows, highs, strict=True)]


def _role(width: float, rng: np.random.Generator) -> Role:
    """Wide rooms are for meetings, narrow ones for washing, the rest mostly for work."""
    if width > 5.4:
        return Role.LIVING
    if width < 3.9:
        return Role.BATH if rng.random() < 0.5 else Role.STUDY
    return (Role.STUDY, Role.STUDY, Role.BEDROOM, Role.KITCHEN)[rng.integers(4)]


def _between_x(first: int, second: int, wall_x: float, along: tuple[float, float]) -> Doorway:
    return Doorway(rooms=(first, second), x=(wall_x, wall_x + WALL_M), y=along, across_x=True)


def _span(room: tuple[float, float], where: float, width: float) -> tuple[float, float]:
    """An interval of `width` inside `room` with at least 25 cm left at either end, at fraction `where`."""
    lower = room[0] + 0.25 + where * (room[1] - room[0] - 0.5 - width)
    return lower, lower + width


def windows_of(rooms: list[Room], width: float, depth: float, rng: np.random.Generator) -> tuple[Window, ...]:
    """Windows in the outer walls of a plan that reaches from 0 to `width` in x and to `depth` in y."""
    windows = []
    for number, room in enumerate(rooms):
        sides = [
            side
            for side, outside in (
                ("x", room.x[0] == 0.0),
                ("X", room.x[1] == width),
                ("y", room.y[0] == 0.0),
                ("Y", room.y[1] == depth),
            )
            if outside
        ]
        if room.role == Role.BATH:
            sides = sides[-1:]
        for side in sides:
            along = room.y if side in "xX" else room.x
            if along[1] - along[0] < 2.0:
                continue
            count = 2 if along[1] - along[0] > 6.0 else 1
            for k in range(count):
                part = (along[1] - along[0]) / count
                middle = along[0] + (k + rng.uniform(0.4, 0.6)) * part
                half = 0.35 if room.role == Role.BATH else rng.uniform(0.6, 0.8)
                sill = 1.45 if room.role == Role.BATH else (1.15 if room.role == Role.KITCHEN else 0.92)
                windows.append(
                    Window(room=number, side=side, along=(middle - half, middle + half), z=(sill, 2.1))
                )
    return tuple(windows)


def centred(layout: Layout, width: float, depth: float) -> Layout:
    """A plan that begins at 0, moved so that its middle lies there."""
    return _shifted(layout, -width / 2, -depth / 2)


def _shifted(layout: Layout, dx: float, dy: float) -> Layout:
    def move(span: tuple[float, float], by: float) -> tuple[float, float]:
        return span[0] + by, span[1] + by

    return Layout(
        rooms=tuple(replace(r, x=move(r.x, dx), y=move(r.y, dy)) for r in layout.rooms),
        doorways=tuple(replace(d, x=move(d.x, dx), y=move(d.y, dy)) for d in layout.doorways),
        windows=tuple(replace(w, along=move(w.along, dy if w.side in "xX" else dx)) for w in layout.windows),
    )


def _flipped(span: tuple[float, float]) -> tuple[float, float]:
    return -span[1], -span[0]


def _mirrored_x(layout: Layout) -> Layout:
    other = {"x": "X", "X": "x", "y": "y", "Y": "Y"}
    return Layout(
        rooms=tuple(replace(r, x=_flipped(r.x)) for r in layout.rooms),
        doorways=tuple(replace(d, x=_flipped(d.x)) for d in layout.doorways),
        windows=tuple(
            replace(w, side=other[w.side], along=w.along if w.side in "xX" else _flipped(w.along))
            for w in layout.windows
        ),
    )


def _mirrored_y(layout: Layout) -> Layout:
    other = {"x": "x", "X": "X", "y": "Y", "Y": "y"}
    return Layout(
        rooms=tuple(replace(r, y=_flipped(r.y)) for r in layout.rooms),
        doorways=tuple(replace(d, y=_flipped(d.y)) for d in layout.doorways),
        windows=tuple(
            replace(w, side=other[w.side], along=w.along if w.side in "yY" else _flipped(w.along))
            for w in layout.windows
        ),
    )
