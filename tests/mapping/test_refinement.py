"""Refining a finished map: every keyframe in turn, small steps in the end, and nothing without keyframes."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import LOG_RADIUS, LOGIT_OPACITY, RGB, GaussianMap
from hgs_core.gaussians.optimise import LearningRates, LossWeights
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import DepthFusionConfig
from hgs_core.mapping.depth_filter import training_image
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.keyframes import KeyframeStore
from hgs_core.mapping.refinement import Refinement, RefinementConfig, RefinementStep
from hgs_core.sensing.frame import Frame

CAMERA = CameraIntrinsics.centred(96, 64, 60.0)
N_KEYFRAMES = 4


@pytest.fixture
def archive(tmp_path: Path) -> KeyframeArchive:
    """A wall at x = 2 m, red above and blue below the camera's height, seen from places side by side."""
    store = KeyframeStore(tmp_path / "keyframes", range_m=5.0)
    rgb = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    rgb[: CAMERA.height // 2, :, 0] = 200
    rgb[CAMERA.height // 2 :, :, 2] = 200
    for number in range(N_KEYFRAMES):
        frame = Frame(
            rgb=rgb,
            depth_m=np.full((CAMERA.height, CAMERA.width), 2.0, np.float32),
            intrinsics=CAMERA,
            T_world_camera=level_camera_pose(0.0, 0.1 * number, 1.0, 0.0),
            timestamp_s=float(number),
            sequence=number,
        )
        store.add(training_image(frame, DepthFusionConfig()), frame)
    store.write_transforms(tmp_path / "transforms.json")
    return KeyframeArchive.open(tmp_path)


def grey_wall() -> GaussianMap:
    y, z = np.meshgrid(np.arange(-1.8, 2.1, 0.05), np.arange(-0.2, 2.2, 0.05))
    parameters = np.full((y.size, 8), 0.5, np.float32)
    parameters[:, 0], parameters[:, 1], parameters[:, 2] = 2.0, y.ravel(), z.ravel()
    parameters[:, LOG_RADIUS], parameters[:, LOGIT_OPACITY] = np.log(0.03), 2.0
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=-1)
    return gaussians


def refine(
    gaussians: GaussianMap, archive: KeyframeArchive, config: RefinementConfig, *, steps: int, seed: int = 0
) -> list[RefinementStep]:
    refinement = Refinement(
        gaussians,
        archive,
        config,
        loss=LossWeights(),
        rates=LearningRates(rgb=0.02),
        range_m=5.0,
        rng=np.random.default_rng(seed),
    )
    with refinement:
        return [refinement.step(number / steps) for number in range(steps)]


def test_a_map_becomes_what_its_keyframes_show(archive: KeyframeArchive) -> None:
    gaussians = grey_wall()
    steps = refine(gaussians, archive, RefinementConfig(), steps=80)
    assert steps[-1].colour_l1 < 0.2 * steps[0].colour_l1
    above, below = gaussians.centres_m[:, 2] > 1.1, gaussians.centres_m[:, 2] < 0.9
    seen = gaussians.adam_steps[: gaussians.size] > 40
    assert (gaussians.rgb[above & seen, 0] > 0.6).mean() > 0.95
    assert (gaussians.rgb[below & seen, 2] > 0.6).mean() > 0.95


def test_full_resolution_comes_last(archive: KeyframeArchive) -> None:
    steps = refine(grey_wall(), archive, RefinementConfig(halved_share=0.5), steps=20)
    # The image of a step was asked for one step before.
    assert [step.full_resolution for step in steps] == [False] * 11 + [True] * 9


def test_steps_become_small(archive: KeyframeArchive) -> None:
    gaussians = grey_wall()
    config = RefinementConfig(halved_share=1.0, final_rate=0.001)
    refinement = Refinement(
        gaussians,
        archive,
        config,
        loss=LossWeights(),
        rates=LearningRates(),
        range_m=5.0,
        rng=np.random.default_rng(0),
    )
    moved = []
    with refinement:
        for progress in (0.0, 1.0):
            before = gaussians.rgb.copy()
            refinement.step(progress)
            moved.append(np.abs(gaussians.rgb - before).max())
    assert moved[1] < 0.01 * moved[0]


def test_the_same_seed_gives_the_same_map(archive: KeyframeArchive) -> None:
    first, second = grey_wall(), grey_wall()
    for gaussians in (first, second):
        refine(gaussians, archive, RefinementConfig(), steps=12, seed=7)
    np.testing.assert_array_equal(first.parameters, second.parameters)


def test_every_keyframe_comes_before_any_comes_again(archive: KeyframeArchive) -> None:
    asked: list[int] = []

    class Counting(KeyframeArchive):
        def load_halved(self, index: int):  # type: ignore[no-untyped-def]
            asked.append(index)
            return super().load_halved(index)

    archive.__class__ = Counting
    refine(grey_wall(), archive, RefinementConfig(halved_share=1.0), steps=2 * N_KEYFRAMES)
    assert (
        sorted(asked[:N_KEYFRAMES])
        == sorted(asked[N_KEYFRAMES : 2 * N_KEYFRAMES])
        == list(range(N_KEYFRAMES))
    )


def test_no_keyframes_no_refinement(tmp_path: Path, archive: KeyframeArchive) -> None:
    class Empty(KeyframeArchive):
        def __len__(self) -> int:
            return 0

    archive.__class__ = Empty
    with pytest.raises(MapError, match="no keyframes"):
        refine(grey_wall(), archive, RefinementConfig(), steps=1)


def test_tilted_discs_are_laid_onto_their_wall(archive: KeyframeArchive) -> None:
    """Discs at 30 degrees to the wall, in its place and of its colours: depth turns them into it."""
    balls = grey_wall()
    upper = balls.centres_m[:, 2] > 1.0
    balls.parameters[: balls.size, RGB] = np.where(upper[:, None], [0.784, 0.0, 0.0], [0.0, 0.0, 0.784])
    gaussians = GaussianMap(primitive="disc")
    normal = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0], np.float32)
    gaussians.append(balls.parameters[: balls.size], np.tile(normal, (balls.size, 1)), anchor_keyframe=-1)
    refine(gaussians, archive, RefinementConfig(), steps=80)
    seen = gaussians.adam_steps[: gaussians.size] > 40
    assert np.count_nonzero(seen) > 500
    normals = gaussians.normals[: gaussians.size][seen]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    assert np.median(np.degrees(np.arccos(np.clip(np.abs(normals[:, 0]), 0.0, 1.0)))) < 15.0
