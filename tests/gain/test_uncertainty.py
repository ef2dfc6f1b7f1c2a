import numpy as np
import pytest

from hgs_core.gain.uncertainty import UncertaintyGain, voxel_uncertainty
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelState
from tests.gain.worlds import CAMERA, empty_voxels, gaussians_at, snapshot_of

HERE = np.array([[1.05, 2.05, 1.05]])
REACH_M = (0.5, 2.0)


def half_seen() -> MapSnapshot:
    """Free up to x = 2 m but for one occupied voxel with two Gaussians; unknown beyond."""
    voxels = empty_voxels((4.0, 4.0, 2.0))
    voxels.states[:20] = VoxelState.FREE
    voxels.states[15, 30, 10] = VoxelState.OCCUPIED
    voxels.note_change()
    gaussians = gaussians_at(np.array([[1.52, 3.03, 1.05], [1.58, 3.05, 1.02]]))
    gaussians.information[:2] = np.array([[1.0], [4.0]])
    return snapshot_of(voxels, gaussians)


def test_uncertainty_is_one_where_missing_and_the_posterior_variance_where_occupied() -> None:
    """Lambda 2: the mean of 2 / (1 + 2) and 2 / (4 + 2)."""
    snapshot = half_seen()
    uncertainty = voxel_uncertainty(snapshot, 2.0)
    assert uncertainty[15, 30, 10] == pytest.approx((2 / 3 + 1 / 3) / 2)
    missing = snapshot.voxels.missing()
    assert np.count_nonzero(missing) == 40 * 20
    assert np.all(uncertainty[missing] == 1.0)
    uncertainty[15, 30, 10] = 0.0
    assert np.all(uncertainty[~missing] == 0.0)


def gain() -> UncertaintyGain:
    config = GainConfig(prior_information=2.0, coverage_scale_m3=0.5)
    return UncertaintyGain(config, CAMERA)


def test_a_view_gains_the_uncertainty_of_its_targets_times_the_volume_they_stand_for() -> None:
    """Ahead one missing voxel, to the left the occupied one: never both in one image of 90 degrees, one of
    them for 3 voxels of 1 dm^3."""
    snapshot, one = half_seen(), gain()
    index = np.array([[20, 20, 10], [15, 30, 10]])
    one.aim_at(snapshot.voxels, index, stands_for=3.0, reach_m=REACH_M)
    gains = one.evaluate(snapshot, HERE, observed_share=1.0)
    yaws = np.degrees(gains.yaws_rad).round()
    by_yaw = dict(zip(yaws.tolist(), gains.coverage_by_yaw[0].tolist(), strict=True))
    assert by_yaw[0.0] == pytest.approx(3e-3, rel=1e-5)
    assert by_yaw[90.0] == pytest.approx(1.5e-3, rel=1e-5)
    assert by_yaw[30.0] == pytest.approx(4.5e-3, rel=1e-5)
    assert by_yaw[-180.0] == 0.0
    np.testing.assert_allclose(gains.total_by_yaw, gains.coverage_by_yaw / 0.5)


def test_it_is_the_newest_maps_uncertainty_of_the_same_targets() -> None:
    snapshot, one = half_seen(), gain()
    one.aim_at(snapshot.voxels, np.array([[20, 20, 10]]), stands_for=1.0, reach_m=REACH_M)
    assert one.evaluate(snapshot, HERE, observed_share=1.0).total[0] > 0
    snapshot.voxels.states[20:] = VoxelState.FREE
    snapshot.voxels.note_change()
    assert one.evaluate(snapshot_of(snapshot.voxels), HERE, observed_share=1.0).total[0] == 0


def test_only_targets_within_reach_and_in_sight_count() -> None:
    snapshot, one = half_seen(), gain()
    index = np.array([[20, 20, 10]])  # 1 m ahead
    cases = [
        ((0.5, 2.0), False, True),
        ((1.5, 2.0), False, False),
        ((0.5, 0.8), False, False),
        ((0.5, 2.0), True, False),
    ]
    for reach_m, hidden, is_seen in cases:
        snapshot.voxels.states[15, 18:23, 8:13] = VoxelState.OCCUPIED if hidden else VoxelState.FREE
        snapshot.voxels.note_change()
        one.aim_at(snapshot.voxels, index, stands_for=1.0, reach_m=reach_m)
        found = one.evaluate(snapshot_of(snapshot.voxels), HERE, observed_share=1.0).total[0]
        assert (found > 0) == is_seen, (reach_m, hidden)


def test_a_restored_gain_scores_alike() -> None:
    snapshot, one, two = half_seen(), gain(), gain()
    one.aim_at(snapshot.voxels, np.array([[20, 20, 10]]), stands_for=2.0, reach_m=REACH_M)
    two.restore(one.state())
    first, second = (g.evaluate(snapshot, HERE, observed_share=1.0) for g in (one, two))
    assert first.total[0] > 0
    np.testing.assert_array_equal(first.total_by_yaw, second.total_by_yaw)
