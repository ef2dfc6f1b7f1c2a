import numpy as np
import pytest
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.gain.coverage import surface_by_layer
from hgs_core.gain.viewpoint import CoverageMeasure, GainConfig, ViewGains
from hgs_core.gaussians.information import accumulate_information
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.gain.worlds import (
    CAMERA,
    closed_room,
    empty_voxels,
    evaluator,
    gaussians_at,
    on_surfaces,
    snapshot_of,
)


def yaw_index(gains: ViewGains, yaw_rad: float) -> int:
    return int(np.argmin(np.abs(np.angle(np.exp(1j * (gains.yaws_rad - yaw_rad))))))


def centre_of(voxels: VoxelMap) -> ndarray:
    return (voxels.lower_m() + np.array(voxels.states.shape) * 0.05)[None]


def half_unseen_room() -> VoxelMap:
    """A closed room whose part beyond x = 2.5 m is unobserved."""
    voxels = closed_room((5.0, 4.0, 2.5))
    beyond = voxels.states[25:]
    beyond[beyond == VoxelState.FREE] = VoxelState.UNOBSERVED
    return voxels


# ---------------------------------------------------------------- coverage


def test_a_closed_observed_room_gains_no_coverage() -> None:
    voxels = closed_room()
    gains = evaluator().evaluate(snapshot_of(voxels), centre_of(voxels), observed_share=1.0)
    assert np.all(gains.coverage_by_yaw == 0)
    assert gains.total[0] == 0


@pytest.mark.parametrize("bins", [(48, 16), (120, 32), (240, 64)])
def test_unobserved_space_gains_the_volume_of_the_view(bins: tuple[int, int]) -> None:
    """Volume of the view pyramid up to horizontal distance R: with half-widths a of yaw and T = tan of the
    upper edge, `int_-a^a R^3/3 2 T cos(delta) d delta = 4/3 R^3 T sin(a)`."""
    voxels = empty_voxels((7.0, 7.0, 6.0))
    gains = evaluator(3.0, azimuth_bins=bins[0], elevation_bins=bins[1]).evaluate(
        snapshot_of(voxels), centre_of(voxels), observed_share=0.0
    )
    expected = 4 / 3 * 3.0**3 * (340 / 600) * np.sin(np.arctan(1.0))
    np.testing.assert_allclose(gains.coverage_by_yaw, expected, rtol=0.01)


def test_coverage_is_cut_at_the_border_of_the_map_and_depends_on_the_side_that_is_unseen() -> None:
    voxels = half_unseen_room()
    gains = evaluator().evaluate(snapshot_of(voxels), np.array([[1.5, 2.0, 1.2]]), observed_share=0.0)
    towards, away = yaw_index(gains, 0.0), yaw_index(gains, np.pi)
    assert gains.coverage_by_yaw[0, away] == 0
    unseen_m3 = np.count_nonzero(voxels.states[25:-9, 9:-9, 3:-3] == VoxelState.UNOBSERVED) * 1e-3
    assert 0.4 * unseen_m3 < gains.coverage_by_yaw[0, towards] < unseen_m3
    assert abs(gains.best_yaw_rad[0]) < 0.3


def test_a_wall_blocks_the_view_and_its_gaussians_alone_do_too() -> None:
    open_space, walled, splatted = half_unseen_room(), half_unseen_room(), half_unseen_room()
    walled.states[20, 9:-9, 3:-3] = VoxelState.OCCUPIED
    plane = np.stack(np.meshgrid([2.05], np.arange(0.91, 3.1, 0.02), np.arange(0.31, 2.2, 0.02)), axis=-1)
    wall = gaussians_at(plane.reshape(-1, 3), radius_m=0.011)
    position = np.array([[1.5, 2.0, 1.2]])
    coverage = [
        evaluator().evaluate(snapshot_of(v, g), position, observed_share=0.0).coverage[0]
        for v, g in ((open_space, None), (walled, None), (splatted, wall))
    ]
    assert coverage[0] > 1.0
    assert coverage[1] == 0
    # 25 Gaussians of opacity 0.953 on each voxel's face; a slanted ray meets up to 1.5 times as many.
    tau = 25 * 0.953 * 2 * np.pi * 0.011**2 / 0.01
    assert np.exp(-1.5 * tau) < coverage[2] / coverage[0] < np.exp(-tau)


def test_dismissed_voxels_gain_nothing_and_hide_what_is_behind() -> None:
    voxels = half_unseen_room()
    voxels.attempts[25] = voxels.config.max_attempts
    gains = evaluator().evaluate(snapshot_of(voxels), np.array([[1.5, 2.0, 1.2]]), observed_share=0.0)
    assert np.all(gains.coverage_by_yaw == 0)


@pytest.mark.parametrize(
    ("settings", "unit"),
    [
        ({}, "m³"),
        ({"coverage_measure": CoverageMeasure.PAPER}, "m³ px"),
        ({"coverage_measure": CoverageMeasure.SURFACE}, "m²"),
        ({"method": "surface"}, "m²"),
    ],
)
def test_coverage_says_what_it_is_counted_in(settings: dict, unit: str) -> None:
    assert GainConfig(**settings).coverage_unit == unit


def test_surface_in_open_space_saturates_and_in_a_niche_does_not() -> None:
    """Behind a thin unseen layer as much surface is expected as it is thick, behind a room no more than
    bounds it."""
    thin, thick = half_unseen_room(), half_unseen_room()
    beyond = thin.states[27:]
    beyond[beyond == VoxelState.UNOBSERVED] = VoxelState.FREE
    position = np.array([[1.5, 2.0, 1.2]])

    def coverage(voxels: VoxelMap, measure: CoverageMeasure) -> float:
        gains = evaluator(coverage_measure=measure).evaluate(
            snapshot_of(voxels), position, observed_share=0.0
        )
        return float(gains.coverage[0])

    by_volume = coverage(thin, CoverageMeasure.VOLUME) / coverage(thick, CoverageMeasure.VOLUME)
    by_surface = coverage(thin, CoverageMeasure.SURFACE) / coverage(thick, CoverageMeasure.SURFACE)
    assert by_surface > 1.5 * by_volume


def test_the_papers_measure_counts_voxels_on_pixels_and_grows_with_the_image() -> None:
    voxels = empty_voxels((3.0, 3.0, 3.0))
    position = centre_of(voxels)
    gains = evaluator(1.0, coverage_measure=CoverageMeasure.PAPER).evaluate(
        snapshot_of(voxels), position, observed_share=0.0
    )
    # A ray of 1 m crosses about 10 (|dx| + |dy| + |dz|) voxels: between 11 and 22.
    pixels_times_volume = 1200 * 680 * 1e-3
    assert 11 * pixels_times_volume < gains.coverage[0] < 22 * pixels_times_volume


# ---------------------------------------------------------------- quality


def room_with_gaussians() -> tuple[VoxelMap, ndarray]:
    voxels = closed_room()
    return voxels, on_surfaces(voxels, 4, np.random.default_rng(0))


def test_more_training_information_lowers_the_quality_gain() -> None:
    voxels, points = room_with_gaussians()
    position = centre_of(voxels)
    quality = [
        evaluator(prior_information=1e-3)
        .evaluate(
            snapshot_of(voxels, gaussians_at(points, information=20.0 * n)), position, observed_share=1.0
        )
        .quality[0]
        for n in (1, 2, 8)
    ]
    assert quality[0] > quality[1] > quality[2] > 0
    # Eq. 9's trace: what a view adds over what is held, so halves as the views double (the prior is small).
    assert quality[0] / quality[1] == pytest.approx(2.0, rel=0.02)
    assert quality[0] / quality[2] == pytest.approx(8.0, rel=0.02)


def test_what_is_known_entirely_or_not_there_gains_nothing() -> None:
    voxels, points = room_with_gaussians()
    known = gaussians_at(points, information=1e12)
    assert evaluator().evaluate(snapshot_of(voxels, known), centre_of(voxels), observed_share=1.0).quality[
        0
    ] == pytest.approx(0.0, abs=1e-3)
    assert evaluator().evaluate(snapshot_of(voxels), centre_of(voxels), observed_share=1.0).quality[0] == 0


def test_quality_is_about_the_area_in_view_when_all_was_seen_once_from_there() -> None:
    """A wall 2 m away, seen once from there: one more look is worth the area in view."""
    voxels = empty_voxels((4.0, 6.0, 4.0))
    voxels.states[:] = VoxelState.FREE
    voxels.states[30] = VoxelState.OCCUPIED
    wall = np.stack(np.meshgrid([3.05], np.arange(0, 6, 0.03), np.arange(0, 4, 0.03)), axis=-1).reshape(-1, 3)
    gaussians = gaussians_at(wall + 0.002, information=0.0)
    accumulate_information(gaussians, CAMERA, level_camera_pose(1.05, 3.05, 2.05, 0.0))
    gains = evaluator().evaluate(
        snapshot_of(voxels, gaussians), np.array([[1.05, 3.05, 2.05]]), observed_share=1.0
    )
    area = 4.0 * 4.0 * 340 / 600
    assert gains.quality_by_yaw[0, yaw_index(gains, 0.0)] == pytest.approx(area, rel=0.3)
    assert gains.quality_by_yaw[0, yaw_index(gains, np.pi)] == 0


def test_a_wall_of_splats_hides_what_is_behind_it() -> None:
    voxels = closed_room()
    plane = np.stack(np.meshgrid(np.arange(1.0, 3.0, 0.012), np.arange(0.4, 2.1, 0.012)), axis=-1).reshape(
        -1, 2
    )
    wall = np.column_stack([np.full(len(plane), 2.8), plane])
    behind = wall + np.array([0.3, 0.0, 0.0])
    hidden = gaussians_at(np.concatenate([wall, wall + np.array([0.01, 0.0, 0.0]), behind]), information=1e9)
    hidden.information[2 * len(wall) : hidden.size] = 0.0
    alone = gaussians_at(behind, information=0.0)
    position = np.array([[2.0, 2.0, 1.25]])
    quality = [
        evaluator().evaluate(snapshot_of(voxels, g), position, observed_share=1.0).quality[0]
        for g in (hidden, alone)
    ]
    assert 0 <= quality[0] < 0.01 * quality[1]


# ---------------------------------------------------------------- both, totals, yaws


def turned(voxels: VoxelMap, points: ndarray) -> tuple[VoxelMap, ndarray]:
    """The map turned by 90 degrees counter-clockwise about the z axis through its centre."""
    result = empty_voxels(tuple(float(n) * 0.1 for n in np.array(voxels.states.shape)[[1, 0, 2]]))
    result.states[:] = np.rot90(voxels.states, 1, axes=(0, 1))
    width = voxels.states.shape[1] * 0.1
    return result, np.stack([width - points[:, 1], points[:, 0], points[:, 2]], axis=1)


def test_turning_the_map_turns_the_yaws() -> None:
    rng = np.random.default_rng(2)
    voxels = half_unseen_room()
    for _ in range(6):
        low = np.append(rng.integers(12, 28, 2), 3)
        voxels.states[low[0] : low[0] + 3, low[1] : low[1] + 2, 3 : rng.integers(6, 20)] = VoxelState.OCCUPIED
    points = on_surfaces(voxels, 2, rng)
    position = np.array([[1.133, 1.871, 1.257]])
    gains, gains_turned = (
        evaluator().evaluate(snapshot_of(v, gaussians_at(p)), at, observed_share=0.5)
        for v, p, at in (
            (voxels, points, position),
            (*turned(voxels, points), turned(voxels, position)[1]),
        )
    )
    shift = len(gains.yaws_rad) // 4
    np.testing.assert_allclose(
        np.roll(gains.coverage_by_yaw, shift, axis=1), gains_turned.coverage_by_yaw, rtol=1e-3, atol=1e-4
    )
    np.testing.assert_allclose(
        np.roll(gains.quality_by_yaw, shift, axis=1), gains_turned.quality_by_yaw, rtol=1e-2, atol=1e-3
    )
    turn = np.angle(np.exp(1j * (gains_turned.best_yaw_rad - gains.best_yaw_rad)))
    assert turn[0] == pytest.approx(np.pi / 2)


def test_the_total_is_the_weighed_sum_and_the_best_yaw_its_maximum() -> None:
    voxels = half_unseen_room()
    snapshot = snapshot_of(voxels, gaussians_at(on_surfaces(voxels, 2, np.random.default_rng(0))))
    positions = np.array([[1.5, 2.0, 1.2], [2.0, 1.5, 1.2]])

    def gains(**config: object) -> ViewGains:
        return evaluator(coverage_scale_m3=2.0, quality_scale_m2=4.0, **config).evaluate(
            snapshot, positions, observed_share=0.25
        )

    both = gains()
    np.testing.assert_allclose(both.total_by_yaw, both.coverage_by_yaw / 2 + 0.25 * both.quality_by_yaw / 4)
    np.testing.assert_allclose(both.total, both.total_by_yaw.max(axis=1))
    best = both.total_by_yaw.argmax(axis=1)
    np.testing.assert_allclose(both.best_yaw_rad, both.yaws_rad[best])
    np.testing.assert_allclose(both.coverage, both.coverage_by_yaw[[0, 1], best])
    fixed = gains(adaptive=False)
    np.testing.assert_allclose(fixed.total_by_yaw, both.coverage_by_yaw / 2 + both.quality_by_yaw / 4)
    coverage, quality = gains(use_quality=False), gains(use_coverage=False)
    assert np.all(coverage.quality_by_yaw == 0)
    assert np.all(quality.coverage_by_yaw == 0)
    np.testing.assert_allclose(coverage.total_by_yaw, both.coverage_by_yaw / 2)
    np.testing.assert_allclose(quality.total_by_yaw, 0.25 * both.quality_by_yaw / 4)


def test_coverage_alone_leaves_quality_out_unless_there_is_nothing_else() -> None:
    voxels = half_unseen_room()
    snapshot = snapshot_of(voxels, gaussians_at(on_surfaces(voxels, 2, np.random.default_rng(0))))
    position = np.array([[1.5, 2.0, 1.2]])
    both = evaluator().evaluate(snapshot, position, observed_share=0.5)
    alone = evaluator().evaluate(snapshot, position, observed_share=0.5, coverage_only=True)
    np.testing.assert_array_equal(alone.coverage_by_yaw, both.coverage_by_yaw)
    assert not alone.quality_by_yaw.any()
    no_other = evaluator(use_coverage=False).evaluate(
        snapshot, position, observed_share=0.5, coverage_only=True
    )
    np.testing.assert_array_equal(no_other.quality_by_yaw, both.quality_by_yaw)


def test_each_viewpoint_is_scored_by_itself() -> None:
    voxels = half_unseen_room()
    snapshot = snapshot_of(voxels, gaussians_at(on_surfaces(voxels, 2, np.random.default_rng(0))))
    positions = np.random.default_rng(1).uniform([1.0, 1.0, 0.5], [2.2, 3.0, 2.0], (5, 3))
    together = evaluator().evaluate(snapshot, positions, observed_share=0.5)
    assert together.total_by_yaw.shape == (5, 120)
    for i, position in enumerate(positions):
        alone = evaluator().evaluate(snapshot, position[None], observed_share=0.5)
        np.testing.assert_allclose(alone.coverage_by_yaw[0], together.coverage_by_yaw[i])


def test_a_changed_map_is_read_again() -> None:
    voxels = half_unseen_room()
    one, position = evaluator(), np.array([[1.5, 2.0, 1.2]])
    before = one.evaluate(snapshot_of(voxels), position, observed_share=0.0)
    voxels.states[voxels.states == VoxelState.UNOBSERVED] = VoxelState.FREE
    voxels.note_change()
    after = one.evaluate(snapshot_of(voxels), position, observed_share=0.0)
    assert before.coverage[0] > 0
    assert after.coverage[0] == 0


def test_no_viewpoints_no_map_and_places_off_the_map_are_fine() -> None:
    voxels = closed_room()
    none = evaluator().evaluate(snapshot_of(voxels), np.zeros((0, 3)), observed_share=0.0)
    assert none.total.shape == (0,)
    far = evaluator().evaluate(snapshot_of(voxels), np.array([[99.0, -99.0, 1.0]]), observed_share=0.0)
    assert far.total[0] == 0
    nothing = VoxelMap(voxels.config)
    assert evaluator().evaluate(snapshot_of(nothing), np.zeros((1, 3)), observed_share=0.0).total[0] == 0


def test_a_share_outside_its_bounds_is_refused() -> None:
    voxels = closed_room()
    with pytest.raises(PlanningError, match=r"0\.\.1"):
        evaluator().evaluate(snapshot_of(voxels), centre_of(voxels), observed_share=1.5)


def test_the_camera_of_the_tests_is_the_papers() -> None:
    assert CAMERA.horizontal_fov_rad == pytest.approx(np.pi / 2)


# ---------------------------------------------------------------- expected surface


def room_with_unseen_ceiling() -> VoxelMap:
    """A closed room whose ceiling, and a layer of space under it, is unobserved beyond x = 5 m."""
    voxels = closed_room((8.0, 6.4, 2.6))
    top = voxels.states.shape[2] - 3
    voxels.states[50:-9, 9:-9, top - 1 :] = VoxelState.UNOBSERVED
    voxels.note_change()
    return voxels


def test_layers_are_as_full_of_surface_as_what_was_observed_of_them() -> None:
    """In the layer of the ceiling everything that was seen is occupied; between floor and ceiling only the
    walls are; of layers that nobody saw nothing is known."""
    voxels = room_with_unseen_ceiling()
    fullness = surface_by_layer(voxels, free_path_m=0.8)
    ceiling, middle = voxels.states.shape[2] - 3, 10
    n_seen, prior = np.count_nonzero(voxels.states[..., ceiling]), 500
    assert fullness[ceiling] == pytest.approx((n_seen + prior / 8) / (n_seen + prior) * 8, rel=1e-4)
    assert fullness[ceiling] > 5 * fullness[middle]
    assert fullness[0] == pytest.approx(1.0)


def test_an_unseen_ceiling_is_worth_much_of_its_area() -> None:
    """Seen at a slant through a layer of unseen space 0.1 m thick it is no less there; but a ray that has
    come into its layer is believed to have met it before the layer's end."""
    voxels = room_with_unseen_ceiling()
    gains = evaluator(coverage_measure=CoverageMeasure.SURFACE).evaluate(
        snapshot_of(voxels), np.array([[3.5, 3.2, 1.0]]), observed_share=1.0
    )
    ahead = gains.coverage_by_yaw[0, yaw_index(gains, 0.0)]
    ceiling_m = voxels.states.shape[2] * 0.1 - 0.3
    first_m = 3.5 + (ceiling_m - 1.0) * 600 / 340  # nearer it is above the image
    hidden_m2 = (voxels.states.shape[0] * 0.1 - 0.9 - first_m) * (voxels.states.shape[1] * 0.1 - 1.8)
    assert 0.4 * hidden_m2 < ahead < 1.1 * hidden_m2


def test_new_surface_is_located_where_rays_come_into_unseen_space() -> None:
    voxels, edge = half_unseen_room(), 4
    scorer = evaluator(coverage_measure=CoverageMeasure.SURFACE)
    snapshot, position = snapshot_of(voxels), np.array([[1.5, 2.0, 1.2]])
    gains = scorer.evaluate(snapshot, position, observed_share=1.0)
    towards, away = scorer.new_surface_in_view(
        snapshot, np.repeat(position, 2, axis=0), np.array([0.0, -np.pi])
    )
    assert towards.area_m2.sum() == pytest.approx(gains.coverage_by_yaw[0, yaw_index(gains, 0.0)], rel=1e-5)
    x, y, _ = np.unravel_index(towards.cubes, voxels.states.shape)
    assert set(x.tolist()) == {25 // edge}
    assert y.min() >= 9 // edge
    assert len(away.cubes) == 0
