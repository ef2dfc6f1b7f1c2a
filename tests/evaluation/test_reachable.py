"""Where a cylinder of radius 0.25 m can stand, on rooms solved by hand."""

from collections.abc import Callable

import numpy as np
import pytest

from hgs_core.errors import SceneError
from hgs_core.evaluation.reachable import GRID_M, reachable_positions
from hgs_core.scene.ray_caster import RayCaster


def reach(caster: RayCaster, start: tuple[float, float], height_m: float = 1.1) -> np.ndarray:
    return reachable_positions(caster, start_xy=start, radius_m=0.25, height_m=height_m)


def test_an_empty_room_is_free_up_to_a_radius_from_its_walls(empty_room: RayCaster) -> None:
    """Grid lines strictly more than 0.25 m from the walls: x = 0.5 .. 3.5, y = 0.5 .. 2.5 (13 x 9 places)."""
    expected = np.stack(
        np.meshgrid(np.arange(2, 15) * GRID_M, np.arange(2, 11) * GRID_M, indexing="ij"), axis=-1
    )
    np.testing.assert_allclose(reach(empty_room, (2.0, 1.5)), expected.reshape(-1, 2), atol=1e-9)


def test_nothing_is_reached_through_a_wall(divided_room: RayCaster) -> None:
    assert np.all(reach(divided_room, (1.0, 1.0))[:, 0] < 2.9 - 0.25)
    assert np.all(reach(divided_room, (5.0, 1.0))[:, 0] > 3.1 + 0.25)


@pytest.mark.parametrize(("width_m", "passes"), [(0.7, True), (0.4, False)])
def test_a_door_lets_through_what_fits(
    cast_boxes: Callable[..., RayCaster], width_m: float, passes: bool
) -> None:
    """The door is off the 0.25 m raster on purpose: its middle is at y = 1.37 m."""
    lower, upper = 1.37 - width_m / 2, 1.37 + width_m / 2
    room = cast_boxes(
        [
            ((0, 0, 0), (6, 3, 2.5)),
            ((2.9, 0, 0), (3.1, lower, 2.5)),
            ((2.9, upper, 0), (3.1, 3, 2.5)),
        ]
    )
    assert bool(np.any(reach(room, (1.0, 1.0))[:, 0] > 4)) is passes


def test_a_table_top_blocks_a_tall_robot_only(cast_boxes: Callable[..., RayCaster]) -> None:
    room = cast_boxes([((0, 0, 0), (4, 3, 2.5)), ((1.5, 1.0, 0.7), (2.5, 2.0, 0.75))])
    under = np.array([2.0, 1.5])
    assert not np.any(np.all(np.isclose(reach(room, (0.5, 0.5)), under), axis=1))
    assert np.any(np.all(np.isclose(reach(room, (0.5, 0.5), height_m=0.5), under), axis=1))


def test_a_start_inside_furniture_is_refused(divided_room: RayCaster) -> None:
    with pytest.raises(SceneError, match=r"the start \(3\.00, 1\.00\)"):
        reach(divided_room, (3.0, 1.0))
