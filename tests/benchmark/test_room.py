"""The rooms that benchmarks measure on."""

import numpy as np

from hgs_core.benchmark.room import BenchmarkRoom
from hgs_core.gaussians.render import render
from hgs_core.voxels.voxel_map import VoxelState

SIZE_M = (4.0, 3.0, 2.5)


def test_a_room_is_the_same_at_every_call_and_covered_evenly() -> None:
    room, again = (BenchmarkRoom.furnished(SIZE_M, 5000) for _ in range(2))
    assert room.gaussians.size == 5000
    np.testing.assert_array_equal(room.gaussians.parameters[:5000], again.gaussians.parameters[:5000])
    centres = room.gaussians.centres_m
    assert centres.min() >= 0
    assert np.all(centres <= np.array(SIZE_M) + 1e-6)
    floor = np.count_nonzero(centres[:, 2] < 1e-6) / 5000
    walls_and_floor = 2 * (4 * 3 + 4 * 2.5 + 3 * 2.5)
    extent = room.furniture[:, 3:] - room.furniture[:, :3]
    boxes = 2 * (extent[:, 0] * extent[:, 1] + extent[:, 2] * (extent[:, 0] + extent[:, 1]))
    under_boxes = (extent[:, 0] * extent[:, 1]).sum()
    assert abs(floor - (12 + under_boxes) / (walls_and_floor + boxes.sum())) < 0.02


def test_the_camera_sees_the_room_filled() -> None:
    room = BenchmarkRoom.furnished(SIZE_M, 60_000)
    drawn = render(room.gaussians, *room.view(300, 170))
    assert np.mean(drawn.silhouette > 0.8) > 0.9
    assert 0.5 < np.median(drawn.depth_m) < 5.0
    assert drawn.colour.std() > 0.03


def test_the_snapshot_has_surfaces_free_space_and_something_to_see() -> None:
    room = BenchmarkRoom.furnished(SIZE_M, 20_000)
    snapshot = room.snapshot()
    states = snapshot.voxels.states
    indices, inside = snapshot.voxels.index_of(room.gaussians.centres_m.astype(float))
    assert inside.all()
    assert np.all(states[tuple(indices.T)] == VoxelState.OCCUPIED)
    assert np.count_nonzero(states == VoxelState.FREE) > 8000
    assert np.count_nonzero(states == VoxelState.UNOBSERVED) > 5000
    assert np.all(room.gaussians.information[: room.gaussians.size] > 0)
