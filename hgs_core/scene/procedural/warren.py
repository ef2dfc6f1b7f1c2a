"""Plans that are awkward on purpose: one room or many, narrow corridors, narrow doors, loops and dead ends.

Rooms stand in a grid of random pitch, some of whose rows and columns are only as wide as a corridor; doors
follow a random tree over the grid, so that everything is joined and many rooms are dead ends, and a few more
doors make loops. The robot starts in a dead end, facing anywhere, a wall perhaps.
"""

from __future__ import annotations

import numpy as np

from hgs_core.scene.options import StartOptions
from hgs_core.scene.procedural.layout import WALL_M, Doorway, Layout, Role, Room, centred, windows_of

Cell = tuple[int, int]
Edge = tuple[Cell, Cell]

_ONE_ROOM_SHARE = 0.1
_CORRIDOR_SHARE = 0.3
_LOOP_SHARE = 0.25
"""Of the walls between neighbours that the tree leaves closed."""
_START_INSIDE_M = 0.5
"""The start's distance from the doorway of its room."""


def draw_warren(rng: np.random.Generator) -> Layout:
    """1 to 16 rooms of 1.2 to 4.6 m on every side; doorways are 0.8 to 1.0 m wide."""
    if rng.random() < _ONE_ROOM_SHARE:
        columns, rows = [(0.0, float(rng.uniform(3.0, 6.0)))], [(0.0, float(rng.uniform(3.0, 5.0)))]
    else:
        columns, rows = _stripes(int(rng.integers(2, 5)), rng), _stripes(int(rng.integers(1, 5)), rng)
    cells = [(i, j) for i in range(len(columns)) for j in range(len(rows))]
    number = {cell: k for k, cell in enumerate(cells)}
    rooms = [Room(role=_role(columns[i], rows[j], rng), x=columns[i], y=rows[j]) for i, j in cells]
    doorways = [
        _doorway(rooms, number[a], number[b], across_x=a[0] != b[0], rng=rng) for a, b in _joined(cells, rng)
    ]
    width, depth = columns[-1][1], rows[-1][1]
    windows = windows_of(rooms, width, depth, rng)
    return centred(Layout(rooms=tuple(rooms), doorways=tuple(doorways), windows=windows), width, depth)


def draw_start(layout: Layout, rng: np.random.Generator) -> StartOptions | None:
    """Just inside a dead end, where furniture keeps off the door; None for a single room."""
    doors = [door for door in layout.doorways if _is_dead_end(layout, door)]
    if not doors:
        return None
    door = doors[int(rng.integers(len(doors)))]
    inside = next(k for k in door.rooms if sum(k in other.rooms for other in layout.doorways) == 1)
    room = layout.rooms[inside]
    at = [sum(door.x) / 2, sum(door.y) / 2]
    axis = 0 if door.across_x else 1
    span = room.x if door.across_x else room.y
    edge = min(span, key=lambda value: abs(value - at[axis]))
    at[axis] = edge + np.sign(sum(span) / 2 - edge) * _START_INSIDE_M
    return StartOptions(x_m=float(at[0]), y_m=float(at[1]), yaw_deg=float(rng.uniform(-180.0, 180.0)))


def _stripes(count: int, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Columns (or rows) of rooms side by side, walls between them; no two corridors beside each other."""
    stripes: list[tuple[float, float]] = []
    begin, narrow = 0.0, False
    for _ in range(count):
        narrow = not narrow and bool(rng.random() < _CORRIDOR_SHARE)
        width = float(rng.uniform(1.2, 1.5) if narrow else rng.uniform(2.4, 4.6))
        stripes.append((begin, begin + width))
        begin += width + WALL_M
    return stripes


def _role(x: tuple[float, float], y: tuple[float, float], rng: np.random.Generator) -> Role:
    """Corridors are halls; big rooms may be living rooms, small ones rather baths."""
    shorter, longer = sorted((x[1] - x[0], y[1] - y[0]))
    if shorter < 2.0:
        return Role.HALL
    if shorter < 2.8:
        return Role.BATH if rng.random() < 0.5 else Role.STUDY
    roles = [Role.KITCHEN, Role.BEDROOM, Role.STUDY, *([Role.LIVING] if longer > 3.8 else [])]
    return roles[int(rng.integers(len(roles)))]


def _joined(cells: list[Cell], rng: np.random.Generator) -> list[Edge]:
    """Edges of a random tree over all cells, grown depth first, and some of the others."""
    known, trail, edges = {cells[0]}, [cells[0]], []
    while trail:
        i, j = trail[-1]
        beside = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
        new = [cell for cell in beside if cell in cells and cell not in known]
        if not new:
            trail.pop()
            continue
        cell = new[int(rng.integers(len(new)))]
        edges.append((trail[-1], cell))
        known.add(cell)
        trail.append(cell)
    walls = [((i, j), other) for i, j in cells for other in ((i + 1, j), (i, j + 1)) if other in cells]
    closed = [wall for wall in walls if wall not in edges and wall[::-1] not in edges]
    return edges + [wall for wall in closed if rng.random() < _LOOP_SHARE]


def _doorway(
    rooms: list[Room], first: int, second: int, *, across_x: bool, rng: np.random.Generator
) -> Doorway:
    a, b = rooms[first], rooms[second]
    along = a.y if across_x else a.x
    width = float(rng.uniform(0.8, 1.0))
    margin = min(0.25, (along[1] - along[0] - width) / 2)
    lower = along[0] + margin + rng.random() * (along[1] - along[0] - width - 2 * margin)
    opening = (float(lower), float(lower) + width)
    edge = min(a.x[1], b.x[1]) if across_x else min(a.y[1], b.y[1])
    wall = (edge, edge + WALL_M)
    return Doorway(
        rooms=(first, second),
        x=wall if across_x else opening,
        y=opening if across_x else wall,
        across_x=across_x,
    )


def _is_dead_end(layout: Layout, door: Doorway) -> bool:
    return any(sum(k in other.rooms for other in layout.doorways) == 1 for k in door.rooms)
