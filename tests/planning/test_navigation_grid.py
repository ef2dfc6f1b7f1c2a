import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import distance_transform_edt

from hgs_core.native import kernels
from hgs_core.planning.navigation_grid import NavigationConfig, build_navigation_grid
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.voxels.voxel_map import VoxelState
from tests.planning.floors import empty_map, grid_of, room

masks = arrays(
    np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.sampled_from([0, 0, 0, 1])
)


def box_distance(point: np.ndarray, blocked: np.ndarray) -> float:
    """To the nearest blocked box or the border, by looking at all of them: the oracle."""
    nx, ny = blocked.shape
    least = max(0.0, min(point[0], nx - point[0], point[1], ny - point[1]))
    for i, j in np.argwhere(blocked):
        away = np.maximum(np.abs(point - (i + 0.5, j + 0.5)) - 0.5, 0.0)
        least = min(least, float(np.hypot(*away)))
    return least


@given(blocked=masks)
def test_clearance_equals_the_oracle(blocked: np.ndarray) -> None:
    clearance = kernels.grid_box_clearance(blocked, 4.0)
    for i, j in np.ndindex(blocked.shape):
        assert clearance[i, j] == pytest.approx(min(4.0, box_distance(np.array([i + 0.5, j + 0.5]), blocked)))


def test_clearance_equals_a_distance_transform_of_the_doubled_lattice() -> None:
    """On a lattice of half cells a box is 3 x 3 points, one of them its nearest to a cell's centre."""
    blocked = np.random.default_rng(3).random((60, 50)) < 0.05
    lattice = np.ones((2 * 60 + 1, 2 * 50 + 1), bool)
    for i, j in np.argwhere(blocked):
        lattice[2 * i : 2 * i + 3, 2 * j : 2 * j + 3] = False
    lattice[[0, -1]] = lattice[:, [0, -1]] = False
    expected = distance_transform_edt(lattice)[1::2, 1::2] / 2
    clearance = kernels.grid_box_clearance(blocked.view(np.uint8), 6.0)
    np.testing.assert_allclose(clearance, np.minimum(expected, 6.0), atol=1e-5)


@given(blocked=masks, seed=st.integers(0, 1000))
def test_segment_clearance_equals_the_oracle(blocked: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    segment = (rng.random(4) * np.tile(blocked.shape, 2) * 1.2 - 0.2).reshape(1, 4)
    clearance = kernels.grid_box_clearance(blocked, 4.0)
    soft = np.ones(blocked.shape, np.float32)
    least, _ = kernels.grid_segments(blocked, clearance, soft, segment, 0.25, 4.0)
    n = max(1, int(np.ceil(np.hypot(*(segment[0, 2:] - segment[0, :2])) / 0.25)))
    points = segment[0, :2] + np.linspace(0, 1, n + 1)[:, None] * (segment[0, 2:] - segment[0, :2])
    inside = np.all((points >= 0) & (points < blocked.shape), axis=1)
    expected = min(
        [4.0, *(box_distance(p, blocked) if ok else 0.0 for p, ok in zip(points, inside, strict=True))]
    )
    assert least[0] == pytest.approx(expected, abs=1e-6)


def test_a_segment_costs_its_length_where_cost_is_one() -> None:
    blocked = np.zeros((40, 40), np.uint8)
    clearance = kernels.grid_box_clearance(blocked, 5.0)
    segment = np.array([[5.0, 5.0, 25.0, 20.0]])
    _, cost = kernels.grid_segments(blocked, clearance, np.ones((40, 40), np.float32), segment, 0.25, 5.0)
    assert cost[0] == pytest.approx(25.0)


def test_what_makes_a_cell_traversable() -> None:
    voxels = empty_map(4, 1)
    voxels.states[0, 0, 1] = VoxelState.FREE  # the scanner's layer alone
    voxels.states[1, 0, 10] = VoxelState.FREE  # seen by the camera, something low in the column
    voxels.states[1, 0, 4] = VoxelState.OCCUPIED
    voxels.states[2, 0, 12] = VoxelState.FREE  # above the body: says nothing
    voxels.states[3, 0, 0] = VoxelState.OCCUPIED  # floor
    voxels.states[3, 0, 5] = VoxelState.FREE
    voxels.states[3, 0, 13] = VoxelState.OCCUPIED  # above the body: no obstacle
    assert grid_of(voxels).blocked[:, 0].tolist() == [False, True, True, False]


def test_the_centre_keeps_its_radius_from_every_blocked_box() -> None:
    grid = grid_of(room(40, 30))
    i = np.arange(40)
    # Walls are the cells 0 and 39: the centre of cell i is (i - 0.5) cells from the left wall's box.
    expected = (i >= 3) & (i <= 36)
    assert np.array_equal(grid.passable[:, 15], expected)
    assert grid.clearance_m[3, 15] == pytest.approx(0.25)
    assert grid.cost[3, 15] > grid.cost[4, 15] > grid.cost[5, 15] == pytest.approx(1.0)


def test_unobserved_columns_cost_more() -> None:
    voxels = room(40, 30)
    voxels.states[20:, :, 2:] = VoxelState.UNOBSERVED
    grid = grid_of(voxels)
    assert grid.passable[30, 15]
    assert grid.cost[30, 15] > 3 * grid.cost[10, 15]


def test_the_robot_stands_on_free_floor() -> None:
    voxels = empty_map(40, 40)
    grid = grid_of(voxels, at=(2.03, 1.98))
    assert grid.path_clearance_m(np.array([[2.03, 1.98]]))[0] >= 0.25 - 1e-9
    assert grid.blocked[10, 10]
    voxels.states[18, 20, 5] = VoxelState.OCCUPIED  # an obstacle is not wished away
    assert grid_of(voxels, at=(2.03, 1.98)).blocked[18, 20]


def test_a_part_of_the_grid_agrees_with_the_whole() -> None:
    rng = np.random.default_rng(0)
    voxels = room(80, 60)
    for i, j in rng.integers(5, 55, (25, 2)):
        voxels.states[i, j, 1:6] = VoxelState.OCCUPIED
    whole = grid_of(voxels)
    path = np.array([[1.0, 1.0], [3.0, 2.0], [4.0, 5.0]])
    part = build_navigation_grid(
        voxels, NavigationConfig(), DifferentialConfig(), robot_xy_m=None, around_m=path
    )
    assert part.blocked.size < whole.blocked.size
    np.testing.assert_allclose(part.path_clearance_m(path), whole.path_clearance_m(path), atol=1e-9)


def test_cells_and_centres_invert_each_other() -> None:
    grid = grid_of(room(20, 30))
    cells = np.arange(grid.blocked.size)
    back, inside = grid.cells_of(grid.centres_m(cells))
    assert np.array_equal(back, cells)
    assert inside.all()
    assert not grid.cells_of(np.array([[-0.05, 1.0]]))[1][0]
