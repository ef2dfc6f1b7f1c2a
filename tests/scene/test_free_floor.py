import numpy as np
import pytest

from hgs_core.errors import SceneError
from hgs_core.scene.free_floor import FreeFloor, choose_start, start_fault
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.textured_mesh import concatenated
from tests.scene.worlds import quad, room, with_boxes


def test_the_start_of_an_empty_room_is_its_middle_line_heading_along_it():
    start = choose_start(RayCaster(room()), 0.25, 1.1)
    assert abs(start.y_m) < 0.06
    assert abs(start.x_m) < 1.05
    assert abs(np.sin(start.yaw_rad)) < 0.4


def test_the_start_lies_in_the_larger_part_of_a_divided_room():
    caster = RayCaster(with_boxes(((0.8, -2.0, 0.0), (1.0, 2.0, 2.5))))
    start = choose_start(caster, 0.25, 1.1)
    assert start.x_m < 0.8
    assert start_fault(caster, BodyObstacles(caster.mesh, 1.1), start.x_m, start.y_m, 0.25) is None


def test_ground_under_open_sky_counts_only_where_there_is_no_ceiling_at_all():
    ground = quad([(-30, -30, -0.001), (30, -30, -0.001), (30, 30, -0.001), (-30, 30, -0.001)])
    indoors = choose_start(RayCaster(concatenated([ground, room()])), 0.25, 1.1)
    assert abs(indoors.x_m) < 3
    assert abs(indoors.y_m) < 2
    open_sky = choose_start(RayCaster(ground), 0.25, 1.1)
    assert abs(open_sky.x_m) < 30


def test_no_free_floor_says_what_was_found():
    full = with_boxes(((-2.9, -1.9, 0.0), (2.9, 1.9, 0.9)))
    with pytest.raises(SceneError, match=r"no free floor .*largest area free of obstacles has 0\.0 m2"):
        choose_start(RayCaster(full), 0.25, 1.1)


def test_faults_of_a_start():
    caster = RayCaster(with_boxes(((0.5, 0.5, 0.0), (1.5, 1.2, 0.8))))
    obstacles = BodyObstacles(caster.mesh, 1.1)
    assert start_fault(caster, obstacles, 0.0, -1.0, 0.25) is None
    assert "obstacle is 0.10 m away" in (start_fault(caster, obstacles, 0.4, 0.8, 0.25) or "")
    assert "no floor" in (start_fault(caster, obstacles, 8.0, 0.0, 0.25) or "")


def test_reachable_cells_stop_at_a_gap_that_is_too_narrow():
    wall = ((-0.1, -2.0, 0.0), (0.1, 0.0, 2.5)), ((-0.1, 0.45, 0.0), (0.1, 2.0, 2.5))
    caster = RayCaster(with_boxes(*wall))
    floor = FreeFloor.of(caster, BodyObstacles(caster.mesh, 1.1))
    beyond = floor.cells_m[..., 0] > 0.5
    assert not (floor.reachable(-1.5, 0.0, 0.25) & beyond).any()
    assert (floor.reachable(-1.5, 0.0, 0.15) & beyond).any()
