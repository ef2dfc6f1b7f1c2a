import numpy as np
import pytest

from hgs_core.planning.path_search import reach_from
from hgs_core.planning.roadmap import Roadmap, RoadmapConfig
from hgs_core.planning.sampling import poisson_disk
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.planning.floors import grid_of, room

ENDS = np.array([[1.0, 1.0], [7.0, 4.0]])


def divided_room(door: bool = True) -> VoxelMap:
    voxels = room(80, 50)
    voxels.states[40, :, 1:] = VoxelState.OCCUPIED
    if door:
        voxels.states[40, 20:30, 1:] = VoxelState.FREE
    return voxels


def grown(voxels: VoxelMap, *, cycles: int = 4) -> Roadmap:
    roadmap = Roadmap(RoadmapConfig())
    rng = np.random.default_rng(0)
    for x_m in np.linspace(1.05, 6.5, cycles):
        robot = np.array([x_m, 2.55])
        grid = grid_of(voxels, at=(float(x_m), 2.55))
        roadmap.grow(grid, reach_from(grid, robot), rng)
    return roadmap


def test_nodes_keep_their_spacing_and_routes_their_clearance() -> None:
    voxels = divided_room()
    roadmap, grid = grown(voxels), grid_of(voxels)
    apart = np.linalg.norm(roadmap.nodes_m[:, None] - roadmap.nodes_m[None], axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() >= 0.8
    route = roadmap.routes(grid, ENDS).route(0, 1)
    assert route is not None
    assert grid.path_clearance_m(route).min() >= 0.25 - 1e-6
    assert np.any(np.abs(route[:, 0] - 4.05) < 1.0)  # through the door


def test_route_costs_agree_with_the_distance_matrix() -> None:
    voxels = divided_room()
    roadmap, grid = grown(voxels), grid_of(voxels)
    places = np.array([[1.0, 1.0], [7.0, 4.0], [2.0, 4.0]])
    routes = roadmap.routes(grid, places)
    costs = routes.costs_m
    np.testing.assert_allclose(costs, costs.T)
    for a in range(3):
        for b in range(a + 1, 3):
            route = routes.route(a, b)
            assert route is not None
            np.testing.assert_array_equal(route[[0, -1]], places[[a, b]])
            assert grid.check_segments(route[:-1], route[1:])[1].sum() == pytest.approx(costs[a, b], rel=1e-6)


def test_an_edge_that_became_blocked_is_not_used() -> None:
    roadmap = grown(divided_room())
    shut = divided_room(door=False)
    grid = grid_of(shut, at=(1.05, 2.55))
    roadmap.grow(grid, reach_from(grid, np.array([1.05, 2.55])), np.random.default_rng(1))
    assert roadmap.routes(grid, ENDS).route(0, 1) is None
    assert np.isinf(roadmap.routes(grid, ENDS).costs_m[0, 1])
    again = grid_of(divided_room(), at=(1.05, 2.55))
    roadmap.grow(again, reach_from(again, np.array([1.05, 2.55])), np.random.default_rng(1))
    assert roadmap.routes(again, ENDS).route(0, 1) is not None


def test_a_restored_roadmap_grows_on_alike() -> None:
    voxels = divided_room()
    first = grown(voxels, cycles=2)
    second = Roadmap(RoadmapConfig())
    second.restore(first.state())
    grid = grid_of(voxels, at=(6.0, 2.55))
    for roadmap in (first, second):
        roadmap.grow(grid, reach_from(grid, np.array([6.0, 2.55])), np.random.default_rng(5))
    assert np.array_equal(first.nodes_m, second.nodes_m)
    assert np.array_equal(first.edges, second.edges)


def test_samples_are_spread_maximal_and_prefer_the_preferred() -> None:
    points = np.random.default_rng(0).random((400, 2)) * 6
    taken = np.array([[3.0, 3.0]])
    chosen = points[poisson_disk(points, 1.5, np.random.default_rng(1), taken_m=taken)]
    everything = np.concatenate([chosen, taken])
    apart = np.linalg.norm(everything[:, None] - everything[None], axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() >= 1.5
    assert np.linalg.norm(points[:, None] - everything[None], axis=2).min(axis=1).max() < 1.5
    again = points[poisson_disk(points, 1.5, np.random.default_rng(1), taken_m=taken)]
    assert np.array_equal(chosen, again)
    left = points[:, 0] < 3
    first = poisson_disk(points, 1.5, np.random.default_rng(1), preferred=left, limit=2)
    assert left[first].all()
    assert len(poisson_disk(np.zeros((0, 2)), 1.5, np.random.default_rng(1))) == 0


def test_edges_are_checked_again_where_the_grid_changed_and_only_there() -> None:
    voxels = divided_room()
    roadmap = grown(voxels)
    before = grid_of(voxels, at=(6.5, 2.55))
    roadmap.grow(before, reach_from(before, np.array([6.5, 2.55])), np.random.default_rng(1))
    voxels.states[60:66, 30:33, 1:8] = VoxelState.OCCUPIED
    voxels.note_change()
    after = grid_of(voxels, at=(6.5, 2.55))
    starts, ends = roadmap.nodes_m[roadmap.edges[:, 0]], roadmap.nodes_m[roadmap.edges[:, 1]]
    changed = after.changed_along(before, starts, ends)
    for old, new in zip(before.check_segments(starts, ends), after.check_segments(starts, ends), strict=True):
        assert np.any(old != new)
        assert not np.any((old != new) & ~changed)
    assert np.mean(changed) < 0.5

    kept, anew = Roadmap(roadmap.config), Roadmap(roadmap.config)
    kept.restore(roadmap.state())
    anew.restore(roadmap.state())
    for grids, renewed in (((before, after), kept), ((after,), anew)):
        for grid in grids:
            renewed.grow(grid, reach_from(grid, np.array([1.05, 2.55])), np.random.default_rng(2))
    np.testing.assert_array_equal(kept.nodes_m, anew.nodes_m)
    np.testing.assert_array_equal(kept.routes(after, ENDS).costs_m, anew.routes(after, ENDS).costs_m)
