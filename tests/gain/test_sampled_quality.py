"""The sampled Fisher score against the exact one, which is summed over every pixel."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from hgs_core.benchmark.room import BenchmarkRoom
from hgs_core.gain.evaluator import PanoramaGainEvaluator
from hgs_core.gain.panorama import PanoramaGrid, by_yaw
from hgs_core.gain.quality import sampled_quality
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.gaussians.information import quality_image
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.native import kernels

PRIOR = 0.1
NARROW = CameraIntrinsics.centred(240, 160, 400.0)
"""33 degrees wide: the cylinder of the panorama is nearly its image plane."""
WIDE = CameraIntrinsics.centred(300, 170, 150.0)


@pytest.fixture(scope="module")
def room() -> BenchmarkRoom:
    room = BenchmarkRoom.furnished((5.0, 4.0, 2.6), 30_000)
    room.snapshot()  # gives it training information
    return room


def exact(room: BenchmarkRoom, camera: CameraIntrinsics, position: np.ndarray, yaw_rad: float) -> float:
    pose = level_camera_pose(*position.tolist(), yaw_rad)
    return float(quality_image(room.gaussians, camera, pose, PRIOR).sum())


def sampled(
    room: BenchmarkRoom, camera: CameraIntrinsics, grid: PanoramaGrid, positions: np.ndarray
) -> np.ndarray:
    score = sampled_quality(
        grid,
        room.gaussians,
        positions,
        prior_information=PRIOR,
        camera=camera,
        range_m=9.0,
        saturation_m=0.0,
    )
    return by_yaw(score, grid.visible_over_z2)


def test_many_rays_sum_up_to_the_exact_score(room: BenchmarkRoom) -> None:
    grid = PanoramaGrid.for_camera(NARROW, n_azimuths=2160, n_elevations=160)
    position = np.array([0.8, 0.8, 1.2])
    scores = sampled(room, NARROW, grid, position[None])[0]
    for k in (1180, 1300, 1420):
        truth = exact(room, NARROW, position, float(grid.yaws_rad[k]))
        assert scores[k] == pytest.approx(truth, rel=0.08)


def test_one_ray_a_bin_ranks_views_as_the_exact_score_does(room: BenchmarkRoom) -> None:
    rng = np.random.default_rng(0)
    # What was seen well, and what was not, lie in different corners.
    n = room.gaussians.size
    room.gaussians.information[:n] *= np.exp(rng.normal(0, 1, (n, 1)) + room.gaussians.centres_m[:, :1])
    grid = PanoramaGrid.for_camera(WIDE, n_azimuths=120, n_elevations=32)
    positions = room.viewpoints_m(30)
    scores = sampled(room, WIDE, grid, positions)
    ks = rng.integers(0, 120, len(positions))
    truth = [exact(room, WIDE, p, float(grid.yaws_rad[k])) for p, k in zip(positions, ks, strict=True)]
    assert spearmanr(scores[np.arange(len(ks)), ks], truth)[0] > 0.9
    assert np.argmax(truth) in np.argsort(-scores[np.arange(len(ks)), ks])[:3]


def test_scores_do_not_depend_on_the_threads(room: BenchmarkRoom) -> None:
    grid = PanoramaGrid.for_camera(WIDE, n_azimuths=60, n_elevations=16)
    threads = kernels.threads()
    scores = []
    for n in (1, 3):
        kernels.set_threads(n)
        scores.append(sampled(room, WIDE, grid, room.viewpoints_m(4)))
    kernels.set_threads(threads)
    np.testing.assert_array_equal(*scores)


def test_a_small_map_after_a_large_one_scores_as_before_it(room: BenchmarkRoom) -> None:
    grid = PanoramaGrid.for_camera(WIDE, n_azimuths=60, n_elevations=16)
    small = BenchmarkRoom.furnished((2.0, 2.0, 2.2), 900)
    small.snapshot()
    before = sampled(small, WIDE, grid, small.viewpoints_m(2))
    sampled(room, WIDE, grid, room.viewpoints_m(2))
    np.testing.assert_array_equal(sampled(small, WIDE, grid, small.viewpoints_m(2)), before)


def test_nearness_beyond_saturation_gains_no_more(room: BenchmarkRoom) -> None:
    gains = [
        PanoramaGainEvaluator(
            GainConfig(quality_measure="sampled", quality_saturation_m=saturation_m), WIDE, 5.0
        ).evaluate(room.snapshot(), np.array([[0.7, 0.7, 1.2]]), observed_share=1.0)
        for saturation_m in (0.0, 1.5, 9.0)
    ]
    near, medium, far = (g.quality_by_yaw.sum() for g in gains)
    assert near > medium > far > 0
