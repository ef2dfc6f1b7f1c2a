"""Where furniture can stand in a room so that a robot still gets everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from hgs_core.scene.procedural.layout import Layout

PASSAGE_RADIUS_M = 0.36
"""A disc of this radius must get from every doorway of a room to every other."""

_CELL_M = 0.05
_MARGIN_M = 0.6
_DOOR_DEPTH_M = 0.75
_MIN_OPEN_SHARE = 0.2
_CURTAIN_M = 0.5


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    x: tuple[float, float]
    y: tuple[float, float]

    def overlaps(self, other: Rectangle, gap_m: float = 0.0) -> bool:
        return (
            self.x[0] < other.x[1] + gap_m
            and other.x[0] < self.x[1] + gap_m
            and self.y[0] < other.y[1] + gap_m
            and other.y[0] < self.y[1] + gap_m
        )


@dataclass(frozen=True, kw_only=True)
class WallPlace:
    """A stretch of wall: `along` is the world coordinate of the piece's middle."""

    side: str
    along: float
    width: float
    height: float


class FloorPlan:
    """The footprints in one room; refuses what would block a passage."""

    def __init__(self, layout: Layout, number: int) -> None:
        self.room = layout.rooms[number]
        self._doors = [d for d in layout.doorways if number in d.rooms]
        self._windows = [w for w in layout.windows if w.room == number]
        self._taken: list[Rectangle] = []
        self._on_walls: list[WallPlace] = []
        self._keep_clear = []
        for door in self._doors:
            wide, deep = 0.05, _DOOR_DEPTH_M
            dx, dy = (deep, wide) if door.across_x else (wide, deep)
            self._keep_clear.append(
                Rectangle(x=(door.x[0] - dx, door.x[1] + dx), y=(door.y[0] - dy, door.y[1] + dy))
            )

    def at_wall(
        self,
        rng: np.random.Generator,
        width: float,
        depth: float,
        height: float,
        *,
        access_m: float = 0.5,
        sides: str = "xXyY",
        near: float | None = None,
    ) -> WallPlace | None:
        """Takes a place for a piece with its back to a wall, `access_m` of free floor before it, or None."""
        options = []
        for side in sides:
            extent = self.room.y if side in "xX" else self.room.x
            low, high = extent[0] + width / 2 + 0.03, extent[1] - width / 2 - 0.03
            if low <= high:
                options += [(side, float(a)) for a in np.arange(low, high + 1e-9, 0.1)]
        rng.shuffle(options)
        if near is not None:
            options.sort(key=lambda option: round(abs(option[1] - near), 1))
        for side, along in options:
            place = WallPlace(side=side, along=along, width=width, height=height)
            if self._hides_window(place):
                continue
            footprint = self._rectangle(side, along, width, (0.0, depth + 0.02))
            before = self._rectangle(side, along, width, (depth, depth + access_m))
            if any(before.overlaps(taken) for taken in self._taken):
                continue
            if self._take(footprint):
                self._on_walls.append(place)
                return place
        return None

    def in_the_open(
        self, rng: np.random.Generator, width: float, depth: float, *, gap_m: float = 0.75
    ) -> tuple[float, float] | None:
        """Takes a place for a piece used from all sides, `gap_m` from everything; its centre."""
        (x0, x1), (y0, y1) = self.room.x, self.room.y
        xs = np.arange(x0 + width / 2 + gap_m, x1 - width / 2 - gap_m + 1e-9, 0.1)
        ys = np.arange(y0 + depth / 2 + gap_m, y1 - depth / 2 - gap_m + 1e-9, 0.1)
        options = [(float(x), float(y)) for x in xs for y in ys]
        rng.shuffle(options)
        for x, y in options:
            footprint = Rectangle(x=(x - width / 2, x + width / 2), y=(y - depth / 2, y + depth / 2))
            if not any(footprint.overlaps(t, gap_m) for t in self._taken) and self._take(footprint):
                return x, y
        return None

    def before(
        self, place: WallPlace, distance: float, width: float, depth: float
    ) -> tuple[float, float] | None:
        """Takes a place in front of a piece, its near edge `distance` from the wall; its centre, or None."""
        footprint = self._rectangle(place.side, place.along, width, (distance, distance + depth))
        if any(footprint.overlaps(t) for t in self._taken) or not self._take(footprint):
            return None
        return sum(footprint.x) / 2, sum(footprint.y) / 2

    def on_wall(self, rng: np.random.Generator, width: float, lowest_m: float) -> WallPlace | None:
        """Takes wall from `lowest_m` up that has no doorway, window, curtain or tall piece, or None."""
        options = []
        for side in "xXyY":
            extent = self.room.y if side in "xX" else self.room.x
            low, high = extent[0] + width / 2 + 0.15, extent[1] - width / 2 - 0.15
            options += [(side, float(a)) for a in np.arange(low, high + 1e-9, 0.1)] if low <= high else []
        rng.shuffle(options)
        for side, along in options:
            place = WallPlace(side=side, along=along, width=width, height=3.0)
            piece = self._rectangle(side, along, width, (0.0, 0.05))
            blocked = any(
                other.side == side
                and other.height > lowest_m
                and abs(other.along - along) < (other.width + width) / 2 + 0.1
                for other in self._on_walls
            )
            if (
                not blocked
                and not self._hides_window(place)
                and not any(piece.overlaps(k) for k in self._keep_clear)
            ):
                self._on_walls.append(place)
                return place
        return None

    def _rectangle(self, side: str, along: float, width: float, out: tuple[float, float]) -> Rectangle:
        """A footprint `width` long at the wall, from `out[0]` to `out[1]` into the room."""
        span = (along - width / 2, along + width / 2)
        (x0, x1), (y0, y1) = self.room.x, self.room.y
        return {
            "x": Rectangle(x=(x0 + out[0], x0 + out[1]), y=span),
            "X": Rectangle(x=(x1 - out[1], x1 - out[0]), y=span),
            "y": Rectangle(x=span, y=(y0 + out[0], y0 + out[1])),
            "Y": Rectangle(x=span, y=(y1 - out[1], y1 - out[0])),
        }[side]

    def _hides_window(self, place: WallPlace) -> bool:
        return any(
            window.side == place.side
            and place.height > window.z[0] - 0.08
            and place.along + place.width / 2 > window.along[0] - _CURTAIN_M
            and place.along - place.width / 2 < window.along[1] + _CURTAIN_M
            for window in self._windows
        )

    def _take(self, footprint: Rectangle) -> bool:
        (x0, x1), (y0, y1) = self.room.x, self.room.y
        inside = (
            footprint.x[0] >= x0 and footprint.x[1] <= x1 and footprint.y[0] >= y0 and footprint.y[1] <= y1
        )
        if not inside or any(footprint.overlaps(k) for k in self._keep_clear):
            return False
        if any(footprint.overlaps(t, 0.02) for t in self._taken):
            return False
        self._taken.append(footprint)
        if self._passable():
            return True
        self._taken.pop()
        return False

    def _passable(self) -> bool:
        (x0, x1), (y0, y1) = self.room.x, self.room.y
        origin = np.array([x0 - _MARGIN_M, y0 - _MARGIN_M])
        shape = np.ceil((np.array([x1, y1]) + _MARGIN_M - origin) / _CELL_M).astype(int)
        x = origin[0] + (np.arange(shape[0])[:, None] + 0.5) * _CELL_M
        y = origin[1] + (np.arange(shape[1])[None, :] + 0.5) * _CELL_M
        free = (x > x0) & (x < x1) & (y > y0) & (y < y1)
        for door in self._doors:
            wide = (_MARGIN_M, 0.0) if door.across_x else (0.0, _MARGIN_M)
            free |= (
                (x > door.x[0] - wide[0])
                & (x < door.x[1] + wide[0])
                & (y > door.y[0] - wide[1])
                & (y < door.y[1] + wide[1])
            )
        for taken in self._taken:
            free &= ~((x > taken.x[0]) & (x < taken.x[1]) & (y > taken.y[0]) & (y < taken.y[1]))
        clear = ndimage.distance_transform_edt(free) * _CELL_M > PASSAGE_RADIUS_M
        regions, _ = ndimage.label(clear)
        at_doors = set()
        for door in self._doors:
            i, j = ((np.array([sum(door.x), sum(door.y)]) / 2 - origin) / _CELL_M).astype(int)
            at_doors.add(int(regions[i, j]))
        if len(at_doors) != 1 or 0 in at_doors:
            return False
        share = np.count_nonzero(regions == at_doors.pop()) * _CELL_M**2 / self.room.area_m2
        return bool(share >= _MIN_OPEN_SHARE)
