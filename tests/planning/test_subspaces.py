import numpy as np
import pytest

from hgs_core.geometry.boxes import Box
from hgs_core.planning.plan import SubspaceState, UnseenReason
from hgs_core.planning.subspaces import SubspaceConfig, SubspacePartition
from hgs_core.planning.unseen import unseen_regions
from hgs_core.planning.views import ViewMemory, ViewMemoryConfig, turn_rad, wrap_angle
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.planning.floors import empty_map, room


def partition() -> SubspacePartition:
    return SubspacePartition(SubspaceConfig(), origin_m=np.zeros(2))


def hole(voxels: VoxelMap, n: int, *, i: int = 10) -> VoxelMap:
    """`n` missing voxels in a row, free space beside them."""
    voxels.states[5 : 5 + 10, i, 5 : 5 + 9] = VoxelState.FREE
    voxels.states[5 : 5 + n % 10, i, 5 + n // 10] = VoxelState.UNOBSERVED
    for k in range(n // 10):
        voxels.states[5:15, i, 5 + k] = VoxelState.UNOBSERVED
    voxels.note_change()
    return voxels


def test_states_follow_what_has_been_observed() -> None:
    voxels = empty_map(90, 30)
    voxels.states[0:30] = VoxelState.FREE
    voxels.states[30:45, :, :] = VoxelState.FREE
    voxels.states[29] = VoxelState.OCCUPIED
    voxels.note_change()
    parts = partition()
    missing = parts.update(voxels)
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTED
    assert parts.records[1, 0].state is SubspaceState.RECONSTRUCTING  # its far half is a frontier
    assert parts.records[2, 0].state is SubspaceState.UNRECONSTRUCTED
    assert missing.volume_m3.sum() == pytest.approx(np.count_nonzero(voxels.missing()) * 1e-3)
    assert np.all(missing.keys == [1, 0])
    boxes = parts.listing()
    assert [b.lower_m[0] for b in boxes] == [0.0, 3.0, 6.0]
    assert parts.key_of(np.array([4.0, 1.0])) == (1, 0)


def test_hysteresis_of_a_reconstructed_subspace() -> None:
    parts, voxels = partition(), room(30, 30)
    parts.update(hole(voxels, 0))
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTED
    parts.update(hole(voxels, 60))  # 0.06 m^3: above "done", below "reopen"
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTED
    hole(voxels, 60, i=14)
    parts.update(hole(voxels, 60, i=10))  # 0.12 m^3: clear evidence
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTING
    hole(voxels, 0, i=14)
    parts.update(hole(voxels, 60, i=10))
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTING  # still above "done"
    parts.update(hole(voxels, 20))
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTED


def test_an_exhausted_subspace_keeps_its_reason_until_clear_evidence() -> None:
    parts, voxels = partition(), room(30, 30)
    hole(voxels, 80, i=14)
    parts.update(hole(voxels, 60))
    assert parts.with_state(SubspaceState.RECONSTRUCTING) == [(0, 0)]
    parts.exhaust((0, 0), UnseenReason.BELOW_THRESHOLD, places=100)
    parts.update(voxels)
    parts.reconsider((0, 0), places=120)
    assert parts.records[0, 0].exhausted is UnseenReason.BELOW_THRESHOLD
    parts.reconsider((0, 0), places=200)
    assert parts.records[0, 0].state is SubspaceState.RECONSTRUCTING
    parts.exhaust((0, 0), UnseenReason.UNREACHABLE, places=0)
    restored = partition()
    restored.restore(parts.state())
    assert restored.records == parts.records
    assert restored.listing() == parts.listing()


def test_every_unseen_cluster_has_a_reason() -> None:
    parts, voxels = partition(), room(60, 30)
    hole(voxels, 80)  # in the first subspace, exhausted
    voxels.states[40:44, 10:16, 5:9] = VoxelState.UNOBSERVED  # in the second, dismissed
    voxels.attempts[40:44, 10:16, 5:9] = 3
    voxels.states[59, 5:20, 1:12] = VoxelState.FREE  # an opening in the border
    voxels.note_change()
    parts.update(voxels)
    parts.exhaust((0, 0), UnseenReason.UNREACHABLE, places=0)
    places = np.array([[4.0, 1.0]])
    regions = unseen_regions(voxels, parts, places, camera_range_m=5.0, region=None)
    assert [(r.reason, round(r.volume_m3, 3)) for r in regions] == [
        (UnseenReason.UNREACHABLE, 0.08),
        (UnseenReason.OCCLUDED, 0.08),  # its outer layer: the inside has no free neighbour
    ]
    box = Box(lower_m=np.zeros(3), upper_m=np.array([6.0, 3.0, 1.5]))
    bounded = unseen_regions(voxels, parts, places, camera_range_m=5.0, region=box)
    assert {r.reason for r in bounded} >= {UnseenReason.OUT_OF_BOUNDS}


def test_an_open_subspace_was_interrupted() -> None:
    parts, voxels = partition(), room(30, 30)
    parts.update(hole(voxels, 80))
    (region,) = unseen_regions(voxels, parts, np.zeros((0, 2)), camera_range_m=5.0, region=None)
    assert region.reason is UnseenReason.INTERRUPTED


def test_views_taken_are_believed_less_each_time() -> None:
    memory = ViewMemory(ViewMemoryConfig(discount=0.5))
    places = np.array([[0.0, 0.0], [1.0, 0.0]])
    yaws = np.radians([0.0, 20.0, 90.0, -175.0])
    assert np.all(memory.factors(places, yaws) == 1.0)
    memory.add(0.1, 0.0, np.radians(5.0), remaining_share=0.0)
    memory.add(0.0, 0.1, np.radians(-5.0), remaining_share=0.0)
    memory.add(0.0, 0.0, np.radians(170.0), remaining_share=0.0)  # across the seam
    np.testing.assert_allclose(memory.factors(places, yaws), [[0.25, 0.25, 1.0, 0.5], [1, 1, 1, 1]])
    memory.current = (1.0, 0.05, 0.0)
    np.testing.assert_allclose(memory.factors(places, yaws)[1], [0.0, 0.0, 1.0, 1.0])
    memory.current = None
    memory.add(1.3, 0.0, np.radians(100.0), remaining_share=2.0)  # a gain that did not drop reaches farther
    np.testing.assert_allclose(memory.factors(places, yaws), [[0.25, 0.25, 0.5, 0.5], [1.0, 1.0, 0.5, 1.0]])
    again = ViewMemory(ViewMemoryConfig(discount=0.5))
    again.restore(memory.state())
    assert np.array_equal(again.factors(places, yaws), memory.factors(places, yaws))


def test_angles_wrap() -> None:
    np.testing.assert_allclose(wrap_angle(np.array([3 * np.pi, -3.5 * np.pi])), [-np.pi, 0.5 * np.pi])
    assert turn_rad(np.radians(170), np.radians(-170)) == pytest.approx(np.radians(20))
