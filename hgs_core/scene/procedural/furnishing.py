"""Rooms are furnished by role: what is bought is fixed, where it fits is drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hgs_core.scene.procedural import fixtures, furniture
from hgs_core.scene.procedural.layout import CEILING_M, Layout, Role
from hgs_core.scene.procedural.mesh_builder import MeshBuilder
from hgs_core.scene.procedural.placement import FloorPlan, WallPlace
from hgs_core.scene.procedural.shell import wall_frame
from hgs_core.scene.procedural.surfaces import N_PICTURES, Surfaces

Build = Callable[[MeshBuilder, Surfaces, np.random.Generator, float, float], None]

_OFF_WALL_M = 0.016


class _Furnisher:
    """Builds in one room what its floor plan finds a place for."""

    def __init__(
        self, builder: MeshBuilder, layout: Layout, number: int, surfaces: Surfaces, rng: np.random.Generator
    ) -> None:
        self.builder = builder
        self.room = layout.rooms[number]
        self.plan = FloorPlan(layout, number)
        self.surfaces = surfaces
        self.rng = rng

    def frame(self, place: WallPlace) -> MeshBuilder:
        return wall_frame(self.builder, self.room, place.side, place.along).at(0, _OFF_WALL_M)

    def stand(
        self,
        build: Build,
        width: float,
        depth: float,
        height: float,
        *,
        access_m: float = 0.5,
        sides: str = "xXyY",
        near: float | None = None,
    ) -> WallPlace | None:
        """Stands a piece at a wall; None where it fits nowhere."""
        place = self.plan.at_wall(self.rng, width, depth, height, access_m=access_m, sides=sides, near=near)
        if place is not None:
            build(self.frame(place), self.surfaces, self.rng, width, depth)
        return place

    def corner_piece(self, build: Build, size: float, height: float) -> None:
        self.stand(build, size, size, height, access_m=0.0)

    def hang_pictures(self, count: int) -> None:
        for _ in range(count):
            width = float(self.rng.choice([0.5, 0.7, 0.95]))
            height = width * (0.75 if self.rng.random() < 0.7 else 1.2)
            place = self.plan.on_wall(self.rng, width + 0.1, 1.15)
            if place is not None:
                picture = self.surfaces[f"picture_{self.rng.integers(N_PICTURES)}"]
                frame = wall_frame(self.builder, self.room, place.side, place.along)
                fixtures.picture(frame, self.surfaces, picture, width, height, 1.62)

    def lay_rug(self, name: str, at: tuple[float, float], size: tuple[float, float]) -> None:
        """A rug, moved as needed to stay 10 cm off the walls."""
        half_x, half_y = size[0] / 2 + 0.1, size[1] / 2 + 0.1
        x = float(
            np.clip(at[0], self.room.x[0] + half_x, max(self.room.x[1] - half_x, self.room.x[0] + half_x))
        )
        y = float(
            np.clip(at[1], self.room.y[0] + half_y, max(self.room.y[1] - half_y, self.room.y[0] + half_y))
        )
        fixtures.rug(self.builder.at(x, y), self.surfaces[name], self.surfaces["linen"], size)

    def hang_lamp(self, at: tuple[float, float]) -> None:
        fixtures.pendant(self.builder.at(*at), self.surfaces, CEILING_M)

    @property
    def middle(self) -> tuple[float, float]:
        return sum(self.room.x) / 2, sum(self.room.y) / 2


def furnish(builder: MeshBuilder, layout: Layout, surfaces: Surfaces, rng: np.random.Generator) -> None:
    """Furnishes every room; each draws from a stream of its own."""
    streams = rng.spawn(len(layout.rooms))
    for number, room in enumerate(layout.rooms):
        _BY_ROLE[room.role](_Furnisher(builder, layout, number, surfaces, streams[number]))


def _living(f: _Furnisher) -> None:
    long_sides = "xX" if f.room.y[1] - f.room.y[0] > f.room.x[1] - f.room.x[0] else "yY"
    quarter = f.room.y[0] + (f.room.y[1] - f.room.y[0]) * (0.25 if f.rng.random() < 0.5 else 0.75)
    sofa = f.stand(furniture.sofa, 2.1, 0.9, 0.84, access_m=1.4, sides=long_sides, near=quarter)
    if sofa is not None:
        opposite = {"x": "X", "X": "x", "y": "Y", "Y": "y"}[sofa.side]
        table = f.plan.before(sofa, 1.32, 1.1, 0.6)
        if table is not None:
            # The table's length runs along the sofa.
            yaw = {"y": 0.0, "Y": np.pi, "x": -np.pi / 2, "X": np.pi / 2}[sofa.side]
            furniture.coffee_table(f.builder.at(*table, 0.012, yaw).at(0, -0.3), f.surfaces, f.rng, 1.1, 0.6)
            size = (1.9, 2.6) if sofa.side in "xX" else (2.6, 1.9)
            f.lay_rug("rug_a", table, size)
            f.hang_lamp(table)
        f.stand(furniture.tv_bench, 1.7, 0.42, 1.35, sides=opposite + long_sides, near=sofa.along)
    dining = f.plan.in_the_open(f.rng, 1.7, 1.72, gap_m=0.6) or f.plan.in_the_open(
        f.rng, 1.7, 1.72, gap_m=0.45
    )
    if dining is not None:
        furniture.dining_table(f.builder.at(dining[0], dining[1] - 0.86), f.surfaces, f.rng, 1.5, 1.72)
        f.hang_lamp(dining)
    f.stand(furniture.bookshelf, 1.2, 0.3, 1.95)
    f.stand(furniture.sideboard, 1.3, 0.42, 1.15)
    f.stand(furniture.armchair, 0.8, 0.82, 0.95, access_m=0.4)
    f.corner_piece(fixtures.plant, 0.6, 1.3)
    f.corner_piece(furniture.floor_lamp, 0.46, 1.7)
    f.corner_piece(fixtures.plant, 0.5, 1.3)
    f.hang_pictures(6)


def _kitchen(f: _Furnisher) -> None:
    for width in (3.0, 2.4, 1.8, 1.2):
        place = f.stand(fixtures.kitchen_counter, width, 0.62, 1.42, access_m=0.7)
        if place is not None:
            cupboards = f.frame(place)
            fixtures.wall_cupboards(cupboards, f.surfaces, width)
            break
    f.stand(fixtures.fridge, 0.68, 0.68, 1.8, access_m=0.7)
    f.stand(fixtures.worktop, 1.2, 0.62, 1.42, access_m=0.6)
    table = f.plan.in_the_open(f.rng, 1.1, 1.54, gap_m=0.3)
    if table is not None:
        furniture.dining_table(f.builder.at(table[0], table[1] - 0.77), f.surfaces, f.rng, 1.1, 1.54)
    f.hang_lamp(table or f.middle)
    f.corner_piece(fixtures.plant, 0.45, 1.2)
    f.hang_pictures(3)


def _bedroom(f: _Furnisher) -> None:
    beside = 0.48
    bed = f.plan.at_wall(f.rng, 1.6 + 2 * beside, 2.08, 1.06, access_m=0.5)
    if bed is not None:
        frame = f.frame(bed)
        furniture.bed(frame, f.surfaces, f.rng, 1.6, 2.05)
        for side in (-1, 1):
            night = frame.at(side * (0.8 + beside / 2), 0)
            furniture.nightstand(night, f.surfaces, f.rng, 0.42, 0.38)
    else:
        f.stand(furniture.bed, 1.0, 2.05, 1.06)
    f.stand(furniture.wardrobe, 1.5, 0.6, 2.1, access_m=0.55) or f.stand(furniture.wardrobe, 1.1, 0.6, 2.1)
    f.stand(furniture.dresser, 1.0, 0.45, 1.25)
    f.stand(furniture.armchair, 0.78, 0.8, 0.95, access_m=0.3)
    f.corner_piece(fixtures.plant, 0.5, 1.3)
    f.lay_rug("rug_b", f.middle, (2.4, 1.7) if f.room.x[1] - f.room.x[0] > 3.0 else (1.7, 2.4))
    f.hang_lamp(f.middle)
    f.hang_pictures(4)


def _study(f: _Furnisher) -> None:
    f.stand(furniture.desk, 1.5, 1.2, 1.3, access_m=0.3) or f.stand(
        furniture.desk, 1.2, 1.15, 1.3, access_m=0.2
    )
    f.stand(furniture.bookshelf, 1.2, 0.3, 1.95)
    f.stand(furniture.bookshelf, 0.9, 0.3, 1.95)
    f.stand(furniture.armchair, 0.8, 0.82, 0.95, access_m=0.3)
    f.corner_piece(furniture.floor_lamp, 0.46, 1.7)
    f.corner_piece(fixtures.plant, 0.5, 1.3)
    board = f.plan.on_wall(f.rng, 1.0, 1.2)
    if board is not None:
        furniture.shelf_board(
            wall_frame(f.builder, f.room, board.side, board.along), f.surfaces, f.rng, 0.9, 1.35
        )
    f.lay_rug("rug_c", f.middle, (2.1, 1.5))
    f.hang_lamp(f.middle)
    f.hang_pictures(3)


def _bath(f: _Furnisher) -> None:
    f.stand(fixtures.bathtub, 1.6, 0.74, 0.72, access_m=0.4)
    f.stand(fixtures.washstand, 0.8, 0.48, 1.95)
    f.stand(fixtures.toilet, 0.42, 0.66, 0.82)
    f.stand(fixtures.towel_rail, 0.6, 0.14, 1.6, access_m=0.2)
    f.corner_piece(fixtures.plant, 0.42, 1.1)
    f.lay_rug("rug_d", f.middle, (1.0, 0.68))
    f.hang_lamp(f.middle)
    f.hang_pictures(1)


def _hall(f: _Furnisher) -> None:
    f.stand(fixtures.coat_rack, 1.1, 0.3, 1.75, access_m=0.3)
    f.stand(furniture.sideboard, 1.0, 0.32, 1.15, access_m=0.3)
    f.corner_piece(fixtures.plant, 0.42, 1.2)
    length = f.room.x[1] - f.room.x[0]
    f.lay_rug("rug_d", f.middle, (min(3.2, length - 1.6), 0.8))
    for where in (0.25, 0.75):
        f.hang_lamp((f.room.x[0] + where * length, f.middle[1]))
    f.hang_pictures(4)


_BY_ROLE: dict[Role, Callable[[_Furnisher], None]] = {
    Role.LIVING: _living,
    Role.KITCHEN: _kitchen,
    Role.BEDROOM: _bedroom,
    Role.STUDY: _study,
    Role.BATH: _bath,
    Role.HALL: _hall,
}
