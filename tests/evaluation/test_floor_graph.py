"""Shortest ways over floors drawn by hand."""

from collections.abc import Callable

import numpy as np
import pytest

from hgs_core.evaluation.floor_graph import floor_graph
from hgs_core.evaluation.reachable import ReachableFloor, reachable_floor
from hgs_core.scene.ray_caster import RayCaster


def floor_of(cells: np.ndarray) -> ReachableFloor:
    return ReachableFloor(cells=cells, first_cell=np.zeros(2, np.int64))


def test_open_floor_has_straight_ways() -> None:
    """4 x 4 m: no way is more than 1.3 % longer than the straight line, and none is shorter."""
    graph = floor_graph(floor_of(np.ones((81, 81), dtype=bool)))
    assert len(graph.positions_m) == 17 * 17
    straight = np.linalg.norm(graph.positions_m[:, None] - graph.positions_m, axis=-1)
    assert np.all(graph.lengths_m >= straight - 1e-9)
    assert np.all(graph.lengths_m <= 1.014 * straight + 1e-9)


def test_a_way_leads_around_a_wall() -> None:
    """A wall at x = 2 m from y = 0 to 3 m, of one cell: over its end, (0, 0) to (4, 0) is 2 * hypot(2, 3)."""
    cells = np.ones((81, 81), dtype=bool)
    cells[40, :61] = False
    graph = floor_graph(floor_of(cells))
    begin, end = graph.nearest(0, 0), graph.nearest(4, 0)
    length = graph.lengths_m[begin, end]
    assert 2 * np.hypot(2, 3.05) <= length <= 2 * np.hypot(2, 3.25) * 1.014
    way = graph.positions_m[graph.way(begin, end)]
    assert length == pytest.approx(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    assert way[:, 1].max() >= 3.05


def test_a_passage_that_the_grid_misses_is_found_on_the_raster() -> None:
    """A slit of one cell at y = 1.10 m through a wall of 1 m: no straight line joins two places there."""
    cells = np.ones((81, 41), dtype=bool)
    cells[30:51] = False
    cells[30:51, 22] = True
    graph = floor_graph(floor_of(cells))
    length = graph.lengths_m[graph.nearest(0, 1), graph.nearest(4, 1)]
    assert np.all(np.isfinite(graph.lengths_m))
    assert 4.0 < length < 4.4


def test_a_large_floor_gets_a_coarser_grid() -> None:
    floor = floor_of(np.ones((81, 81), dtype=bool))
    assert len(floor_graph(floor, max_places=100).positions_m) == 81
    assert np.isfinite(floor_graph(floor, max_places=100).lengths_m).all()


def test_ways_keep_to_the_room(cast_boxes: Callable[..., RayCaster]) -> None:
    """A door of 0.8 m at the far side of a dividing wall."""
    room = cast_boxes([((0, 0, 0), (6, 4, 2.5)), ((2.9, 0, 0), (3.1, 3.2, 2.5))])
    floor = reachable_floor(room, start_xy=(1.0, 1.0), radius_m=0.25, height_m=1.1)
    graph = floor_graph(floor)
    length = graph.lengths_m[graph.nearest(1, 1), graph.nearest(5, 1)]
    # Around the wall's end at y = 3.2 m with a quarter of a metre to spare: 2 * hypot(1.65, 2.45) + 0.7.
    assert length == pytest.approx(2 * np.hypot(1.65, 2.45) + 0.7, rel=0.04)
