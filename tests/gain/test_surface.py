import numpy as np
import pytest

from hgs_core.gain.registry import build_evaluator
from hgs_core.gain.surface import SurfaceGainEvaluator
from hgs_core.gain.viewpoint import GainConfig, GainEvaluator, ViewGains
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.information import accumulate_information
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.gain.worlds import CAMERA, closed_room, empty_voxels, gaussians_at, on_surfaces, snapshot_of

HERE = np.array([[1.05, 3.05, 2.05]])
AHEAD, BEHIND = 60, 0
"""Yaws 0 and -pi among 120."""
AWAY_M = 1.9
"""From `HERE` to the free voxels before the border at x = 3 m."""


def border(beyond: VoxelState = VoxelState.UNOBSERVED) -> VoxelMap:
    """Free space up to x = 3 m, a layer of `beyond` there, unknown space behind it."""
    voxels = empty_voxels((5.0, 6.0, 4.0))
    voxels.states[:30] = VoxelState.FREE
    voxels.states[30] = beyond
    voxels.note_change()
    return voxels


def surface(**config: object) -> SurfaceGainEvaluator:
    settings = {"surface_patch_m": 0.1, "surface_incidence_deg": 80.0, **config}
    return SurfaceGainEvaluator(GainConfig(method="surface", **settings), CAMERA, 5.0)


def gains(voxels: VoxelMap, gaussians: GaussianMap | None = None, **config: object) -> ViewGains:
    return surface(**config).evaluate(snapshot_of(voxels, gaussians), HERE, observed_share=0.5)


def test_a_border_gains_the_area_that_the_image_shows() -> None:
    """90 degrees wide, 340 / 600 high to either side: 3.8 m times 2.15 m at 1.9 m."""
    area = gains(border()).coverage_by_yaw[0]
    assert area[AHEAD] == pytest.approx(2 * AWAY_M * 2 * AWAY_M * 340 / 600, rel=0.07)
    assert area[BEHIND] == 0.0


@pytest.mark.parametrize("config", [{"surface_distance_m": 2.15}, {"surface_incidence_deg": 27.9}])
def test_it_covers_up_to_a_distance_and_an_angle(config: dict[str, float]) -> None:
    """Both leave a disc of 1.006 m about the foot of the perpendicular."""
    radius = 1.006
    assert gains(border(), **config).coverage_by_yaw[0, AHEAD] == pytest.approx(np.pi * radius**2, rel=0.07)


def test_the_total_counts_in_its_own_scale_and_nothing_is_quality() -> None:
    found = gains(border(), surface_scale_m2=4.0)
    np.testing.assert_allclose(found.total_by_yaw, found.coverage_by_yaw / 4.0)
    assert not found.quality_by_yaw.any()
    assert found.total[0] == found.total_by_yaw.max()


def test_patches_stand_for_the_whole_surface() -> None:
    snapshot = snapshot_of(border())
    fine, thinned = surface().uncovered(snapshot), surface(surface_patch_m=0.3).uncovered(snapshot)
    assert fine.weights.sum() == pytest.approx(6.0 * 4.0)
    assert thinned.weights.sum() == pytest.approx(6.0 * 4.0)
    assert len(thinned.weights) < len(fine.weights) / 6
    assert np.all(thinned.normals == [-1.0, 0.0, 0.0])


def wall(voxels: VoxelMap) -> GaussianMap:
    return gaussians_at(on_surfaces(voxels, 4, np.random.default_rng(0)), information=0.0)


def test_a_wall_of_which_little_was_shown_is_uncovered_and_one_that_was_shown_is_not() -> None:
    voxels = border(VoxelState.OCCUPIED)
    gaussians = wall(voxels)
    area = gains(border()).coverage_by_yaw[0, AHEAD]
    assert gains(voxels, gaussians).coverage_by_yaw[0, AHEAD] == pytest.approx(area)
    gaussians.information[:] = 1e3
    gaussians.version += 1
    assert gains(voxels, gaussians).coverage_by_yaw.max() == 0.0


@pytest.mark.parametrize(("away_m", "share_left"), [(2.0, 0.0), (30.0, 1.0)])
def test_one_look_from_nearby_covers_and_one_from_far_beyond_the_limit_does_not(
    away_m: float, share_left: float
) -> None:
    voxels = border(VoxelState.OCCUPIED)
    gaussians = wall(voxels)
    before = gains(voxels, gaussians, surface_incidence_deg=60.0).coverage_by_yaw[0, AHEAD]
    accumulate_information(gaussians, CAMERA, level_camera_pose(3.0 - away_m, 3.05, 2.05, 0.0))
    after = gains(voxels, gaussians, surface_incidence_deg=60.0).coverage_by_yaw[0, AHEAD]
    assert after / before == pytest.approx(share_left, abs=0.05)


def test_what_is_not_free_hides_what_is_behind() -> None:
    voxels = border()
    voxels.states[20, :, :] = VoxelState.OCCUPIED
    voxels.note_change()
    covered = gaussians_at(on_surfaces(voxels, 4, np.random.default_rng(0)), information=1e3)
    assert gains(voxels, covered).coverage_by_yaw.max() == 0.0


def test_a_finished_room_gains_nothing() -> None:
    voxels = closed_room()
    known = gaussians_at(on_surfaces(voxels, 4, np.random.default_rng(0)), information=1e3)
    found = surface().evaluate(snapshot_of(voxels, known), np.array([[2.0, 2.0, 1.2]]), observed_share=1.0)
    assert found.total[0] == 0.0


def test_a_changed_map_is_read_again() -> None:
    one, voxels = surface(), border()
    assert one.evaluate(snapshot_of(voxels), HERE, observed_share=0.0).total[0] > 0
    voxels.states[30:] = VoxelState.FREE
    voxels.note_change()
    assert one.evaluate(snapshot_of(voxels), HERE, observed_share=0.0).total[0] == 0


def test_it_is_found_by_its_name() -> None:
    evaluator = build_evaluator(GainConfig(method="surface"), CAMERA, 5.0)
    assert isinstance(evaluator, GainEvaluator)
    assert isinstance(evaluator, SurfaceGainEvaluator)
