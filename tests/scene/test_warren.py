"""Awkward homes: joined, narrow, with a start in a dead end."""

import numpy as np
import pytest

from hgs_core.scene.free_floor import start_fault
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.procedural.layout import Layout
from hgs_core.scene.procedural.warren import draw_start, draw_warren
from hgs_core.scene.scene import open_scene

SEEDS = range(60)


def layouts() -> list[Layout]:
    return [draw_warren(np.random.default_rng(seed)) for seed in SEEDS]


def reached(layout: Layout) -> set[int]:
    """Rooms that doors join to the first one."""
    known, left = {0}, [0]
    while left:
        room = left.pop()
        beside = {other for door in layout.doorways if room in door.rooms for other in door.rooms} - known
        known |= beside
        left += beside
    return known


@pytest.mark.parametrize("seed", SEEDS)
def test_all_rooms_are_joined_by_doors_in_their_walls(seed: int) -> None:
    layout = draw_warren(np.random.default_rng(seed))
    assert reached(layout) == set(range(len(layout.rooms)))
    for door in layout.doorways:
        width = door.along[1] - door.along[0]
        assert 0.8 <= width + 1e-9 <= 1.0 + 1e-6
        for number in door.rooms:
            room = layout.rooms[number]
            extent = room.y if door.across_x else room.x
            assert extent[0] < door.along[0]
            assert door.along[1] < extent[1]
            across, walls = (door.x, room.x) if door.across_x else (door.y, room.y)
            assert np.isclose(across, (walls[1], walls[0]), atol=1e-9).any()


def test_there_are_single_rooms_many_rooms_corridors_loops_and_dead_ends() -> None:
    homes = layouts()
    rooms = [len(home.rooms) for home in homes]
    assert min(rooms) == 1
    assert max(rooms) >= 9
    widths = [min(r.x[1] - r.x[0], r.y[1] - r.y[0]) for home in homes for r in home.rooms]
    assert sum(width < 1.5 for width in widths) > 20
    assert sum(len(home.doorways) >= len(home.rooms) for home in homes) > 10  # a tree has one less
    assert sum(draw_start(home, np.random.default_rng(0)) is not None for home in homes) > 40


@pytest.mark.parametrize("seed", [0, 5, 8])
def test_the_robot_can_stand_where_it_starts(seed: int) -> None:
    scene = open_scene(f"warren:{seed}")
    assert not scene.notices
    obstacles = BodyObstacles(scene.mesh, 1.1)
    assert start_fault(scene.caster, obstacles, scene.start.x_m, scene.start.y_m, 0.25) is None
