"""Sampled rays against the exact Fisher score, which is summed over every pixel."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from hgs_core.benchmark.room import BenchmarkRoom
from hgs_core.gain.evaluator import PanoramaGainEvaluator
from hgs_core.gain.exact import exact_coverage, exact_quality
from hgs_core.gain.panorama import PanoramaGrid
from hgs_core.gain.quality import FisherField, RaySample
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.gaussians.gaussian_map import Primitive
from hgs_core.gaussians.information import parameter_priors, quality_image
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.native import kernels
from tests.gain import naive
from tests.gain.worlds import empty_voxels, gaussians_at
from tests.gaussians.maps import PRIMITIVES, gaussian_map

PRIOR, RANGE_M = 0.1, 5.0
NARROW = CameraIntrinsics.centred(240, 160, 400.0)
"""33 degrees wide: the cylinder of the panorama is nearly its image plane."""
WIDE = CameraIntrinsics.centred(300, 170, 150.0)


@pytest.fixture(scope="module")
def room() -> BenchmarkRoom:
    room = BenchmarkRoom.furnished((5.0, 4.0, 2.6), 30_000)
    room.snapshot()  # gives it training information
    return room


def field_of(room: BenchmarkRoom, camera: CameraIntrinsics) -> FisherField:
    voxels = room.snapshot().voxels
    return FisherField(voxels, camera, prior_information=PRIOR, saturation_m=0.0, range_m=RANGE_M)


def everywhere(room: BenchmarkRoom) -> np.ndarray:
    shape = np.array(room.snapshot().voxels.states.shape[:2])
    return np.ones(-(-shape // kernels.GAIN_CHUNK), dtype=bool)


def sampled(
    room: BenchmarkRoom, camera: CameraIntrinsics, sample: RaySample, positions: np.ndarray
) -> np.ndarray:
    field = field_of(room, camera)
    field.gather(room.snapshot(), everywhere(room))
    return field.score_by_yaw(sample, room.snapshot(), positions)


def exact(room: BenchmarkRoom, camera: CameraIntrinsics, position: np.ndarray, yaw_rad: float) -> float:
    pose = level_camera_pose(*position.tolist(), yaw_rad)
    return exact_quality(room.snapshot(), camera, pose, prior_information=PRIOR, range_m=RANGE_M)


@PRIMITIVES
def test_each_ray_scores_what_its_pixel_scores(primitive: Primitive) -> None:
    """The middle column of a camera, turned to each ray in turn, is what a ray is. The camera is wide: how
    discs stretch off its axis is limited by its borders. Rays look for what lies near to them, so no disc is
    so large and near that it reaches the middle from the side of the image, where it is stretched most."""
    rng = np.random.default_rng(3)
    voxels = empty_voxels((4.0, 3.7, 2.5))
    position = np.array([1.73, 1.81, 0.97])
    nearest_m, spread = (0.7, 0.3) if primitive == "disc" else (0.0, 0.7)
    balls = gaussians_at(rng.uniform(0.2, 3.5, (3000, 3)) * [1.0, 1.0, 0.6], radius_m=0.04).parameters[:3000]
    far = np.linalg.norm(balls[:, :3] - position, axis=1) > nearest_m
    gaussians = gaussian_map(primitive, balls[far], rng)
    gaussians.parameters[: gaussians.size, 6] += rng.normal(0, spread, gaussians.size)
    gaussians.parameters[: gaussians.size, 7] = rng.uniform(-6, 5, gaussians.size)
    gaussians.information[: gaussians.size] = 10.0 ** rng.uniform(-2, 2, (gaussians.size, 8))
    gaussians.refresh_blocks()
    rows, focal_px, wide = 9, 40.0, 81
    camera = CameraIntrinsics.centred(wide, wide, focal_px)
    first = (wide - rows) // 2
    grid = PanoramaGrid(
        n_azimuths=24,
        n_elevations=rows,
        tan_low=-rows / 2 / focal_px,
        tan_high=rows / 2 / focal_px,
        first_rad=np.zeros((rows, 24)),
        last_rad=np.zeros((rows, 24)),
        pixels_per_ray=1.0,
    )
    field = kernels.FisherField(
        np.array(voxels.states.shape, np.int64),
        np.zeros(3),
        0.1,
        parameter_priors(PRIOR),
        camera.low_pass_px2 / focal_px**2,
        0.0,
        3.0,
        [wide / 2 / focal_px] * 2,
    )
    parameters, normals = gaussians.parameters[: gaussians.size], gaussians.normals[: gaussians.size]
    field.gather(parameters, normals, gaussians.block_bounds, np.ones((3, 3), dtype=bool))
    scores = np.zeros((1, rows, 24, 2), np.float32)
    information = gaussians.information[: gaussians.size]
    field.score(parameters, normals, information, position[None], grid.tan_low, grid.tan_high, scores)
    expected = np.zeros((rows, 24))
    for row in range(rows):
        for azimuth in range(24):
            yaw_rad, _ = naive.directions(grid, row, azimuth)
            pose = level_camera_pose(*position.tolist(), yaw_rad)
            # Rows of a panorama go up, those of an image down.
            image = quality_image(gaussians, camera, pose, PRIOR, far_m=3.0)
            expected[row, azimuth] = image[first + rows - 1 - row, wide // 2]
    np.testing.assert_allclose(scores[0].sum(axis=-1), expected, rtol=0.02, atol=1e-3 * expected.max())
    assert np.all(scores >= 0)
    assert np.count_nonzero(expected) > 100


def test_many_rays_sum_up_to_the_exact_score(room: BenchmarkRoom) -> None:
    sample = RaySample.for_camera(NARROW, n_azimuths=2160, n_elevations=160)
    position = np.array([0.8, 0.8, 1.2])
    scores = sampled(room, NARROW, sample, position[None])[0]
    for k in (1180, 1300, 1420):
        truth = exact(room, NARROW, position, float(sample.grid.yaws_rad[k]))
        assert scores[k] == pytest.approx(truth, rel=0.1)


def test_few_rays_rank_views_as_the_exact_score_does(room: BenchmarkRoom) -> None:
    rng = np.random.default_rng(0)
    # What was seen well, and what was not, lie in different corners.
    snapshot = room.snapshot()
    n = room.gaussians.size
    before = room.gaussians.information[:n].copy()
    room.gaussians.information[:n] *= np.exp(rng.normal(0, 1, (n, 1)) + room.gaussians.centres_m[:, :1])
    try:
        positions = room.viewpoints_m(30)
        evaluator = PanoramaGainEvaluator(GainConfig(prior_information=PRIOR), WIDE, RANGE_M)
        gains = evaluator.evaluate(snapshot, positions, observed_share=1.0)
        ks = rng.integers(0, 120, len(positions))
        views = np.arange(len(ks)), ks
        yaws = gains.yaws_rad[ks].tolist()
        poses = [level_camera_pose(*p, yaw) for p, yaw in zip(positions.tolist(), yaws, strict=True)]
        quality = [
            exact_quality(snapshot, WIDE, pose, prior_information=PRIOR, range_m=RANGE_M) for pose in poses
        ]
        coverage = [exact_coverage(snapshot, WIDE, pose, range_m=RANGE_M) for pose in poses]
    finally:
        room.gaussians.information[:n] = before
    assert spearmanr(gains.quality_by_yaw[views], quality)[0] > 0.9
    assert np.argmax(quality) in np.argsort(-gains.quality_by_yaw[views])[:3]
    assert spearmanr(gains.coverage_by_yaw[views], coverage)[0] > 0.9


def test_chunks_gathered_one_by_one_score_as_they_do_together(room: BenchmarkRoom) -> None:
    sample = RaySample.for_camera(WIDE, n_azimuths=60, n_elevations=16)
    field, chunks = field_of(room, WIDE), everywhere(room)
    for chunk in np.argwhere(chunks):
        one = np.zeros_like(chunks)
        one[tuple(chunk)] = True
        field.gather(room.snapshot(), one)
    parts = field.score_by_yaw(sample, room.snapshot(), room.viewpoints_m(4))
    np.testing.assert_allclose(parts, sampled(room, WIDE, sample, room.viewpoints_m(4)), rtol=1e-4)


def test_scores_do_not_depend_on_the_threads(room: BenchmarkRoom) -> None:
    sample = RaySample.for_camera(WIDE, n_azimuths=60, n_elevations=16)
    threads = kernels.threads()
    scores = []
    for n in (1, 3):
        kernels.set_threads(n)
        scores.append(sampled(room, WIDE, sample, room.viewpoints_m(4)))
    kernels.set_threads(threads)
    np.testing.assert_array_equal(*scores)


def test_a_field_that_forgets_scores_as_a_new_one(room: BenchmarkRoom) -> None:
    sample = RaySample.for_camera(WIDE, n_azimuths=60, n_elevations=16)
    field = field_of(room, WIDE)
    for _ in range(2):
        field.forget()
        field.gather(room.snapshot(), everywhere(room))
    again = field.score_by_yaw(sample, room.snapshot(), room.viewpoints_m(2))
    np.testing.assert_array_equal(again, sampled(room, WIDE, sample, room.viewpoints_m(2)))


def test_nearness_beyond_saturation_gains_no_more(room: BenchmarkRoom) -> None:
    gains = [
        PanoramaGainEvaluator(GainConfig(quality_saturation_m=saturation_m), WIDE, RANGE_M).evaluate(
            room.snapshot(), np.array([[0.7, 0.7, 1.2]]), observed_share=1.0
        )
        for saturation_m in (0.0, 1.5, 9.0)
    ]
    near, medium, far = (g.quality_by_yaw.sum() for g in gains)
    assert near > medium > far > 0
