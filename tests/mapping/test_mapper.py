"""The mapper: what a frame does to the maps, how many optimisation steps follow, and pruning."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.ndimage import binary_dilation

from hgs_core.gaussians.gaussian_map import CENTRE, LOGIT_OPACITY
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.keyframes import KeyframeStore, TrainingImage
from hgs_core.mapping.mapper import Mapper
from hgs_core.sensing.frame import Frame
from hgs_core.voxels.voxel_map import VoxelState
from tests.mapping.new_mapper import empty_mapper

CAMERA = CameraIntrinsics.centred(120, 80, 60.0)


def worth_keeping(mapper: Mapper) -> np.ndarray:
    """The rule of pruning over the whole map at once."""
    indices, inside = mapper.voxels.index_of(mapper.gaussians.centres_m.astype(np.float64))
    near_surface = binary_dilation(mapper.voxels.states == VoxelState.OCCUPIED, np.ones((3, 3, 3)))
    floats = (mapper.voxels.states == VoxelState.FREE) & ~near_surface
    worth = mapper.gaussians.opacities >= mapper.config.prune_opacity
    worth[inside] &= ~floats[tuple(indices[inside].T)]
    return worth


def wall_ahead(yaw_rad: float, number: int) -> Frame:
    rng = np.random.default_rng(number)
    return Frame(
        rgb=rng.integers(0, 255, (80, 120, 3), dtype=np.uint8),
        depth_m=np.full((80, 120), 2.0, np.float32),
        intrinsics=CAMERA,
        T_world_camera=level_camera_pose(0.0, 0.0, 1.0, yaw_rad),
        timestamp_s=0.4 * number,
        sequence=number,
    )


def smooth_wall(yaw_rad: float, number: int) -> Frame:
    """Colours that change slowly with the direction of the ray, in the world."""
    camera = CameraIntrinsics.centred(240, 160, 120.0)
    pose = level_camera_pose(0.0, 0.0, 1.0, yaw_rad)
    rays = camera.rays() @ pose.rotation.T
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    return Frame(
        rgb=(127.5 + 100.0 * rays).astype(np.uint8),
        depth_m=np.full((160, 240), 2.0, np.float32),
        intrinsics=camera,
        T_world_camera=pose,
        timestamp_s=0.4 * number,
        sequence=number,
    )


class Watched(KeyframeStore):
    """Counts what is loaded."""

    def __init__(self, store: KeyframeStore) -> None:
        self.__dict__.update(store.__dict__)
        self.loads = 0

    def load(self, index: int) -> TrainingImage:
        self.loads += 1
        return super().load(index)


def counted(n_steps: int) -> Callable[[], bool]:
    """Time for so many steps: the first is taken without asking."""
    left = iter([True] * (n_steps - 1))
    return lambda: next(left, False)


@pytest.mark.parametrize(("replay_share", "is_replayed"), [(0.0, False), (0.5, True)])
def test_what_is_out_of_view_is_optimised_on_only_by_replay(
    replay_share: float, is_replayed: bool, tmp_path: Path
) -> None:
    mapper = empty_mapper(MappingConfig(replay_share=replay_share), tmp_path)
    mapper.integrate(wall_ahead(0.0, 0))
    behind = mapper.gaussians.size
    steps = mapper.gaussians.adam_steps[:behind].copy()
    mapper.integrate(wall_ahead(np.pi, 1))
    assert mapper.optimise(interrupted=lambda: False, time_left=counted(20)) == 20
    assert mapper.gaussians.size > behind
    assert bool(np.any(mapper.gaussians.adam_steps[:behind] > steps)) == is_replayed


def test_mission_time_pays_for_the_steps(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(iterations_per_s=6.25), tmp_path)
    counts = []
    for number in range(5):
        mapper.integrate(wall_ahead(0.1 * number, number))
        counts.append(mapper.optimise(interrupted=lambda: False))
    assert counts == [0, 2, 3, 2, 3]


def test_however_little_time_is_left_one_step_is_taken(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(), tmp_path)
    for number in range(3):
        mapper.integrate(wall_ahead(0.1 * number, number))
        assert mapper.optimise(interrupted=lambda: False, time_left=lambda: False) == 1


def test_steps_end_as_soon_as_they_are_interrupted(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(), tmp_path)
    assert mapper.optimise(interrupted=lambda: False) == 0
    mapper.integrate(wall_ahead(0.0, 0))
    goes_on = counted(4)
    assert mapper.optimise(interrupted=lambda: not goes_on(), time_left=lambda: True) == 3


def test_a_frame_that_shows_nothing_new_goes_into_the_voxels_alone(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(), tmp_path)
    first = mapper.integrate(smooth_wall(0.0, 0), may_thin=True)
    assert not first.thinned
    assert first.inserted > 0
    mapper.optimise(interrupted=lambda: False, time_left=counted(30))
    parameters = mapper.gaussians.parameters[: mapper.gaussians.size].copy()
    information = mapper.gaussians.information[: mapper.gaussians.size].copy()
    voxels = mapper.voxels.version

    again = mapper.integrate(smooth_wall(np.radians(0.3), 1), may_thin=True)
    assert again.thinned
    assert again.psnr_predicted_db > 24.0
    np.testing.assert_array_equal(mapper.gaussians.parameters[: mapper.gaussians.size], parameters)
    np.testing.assert_array_equal(mapper.gaussians.information[: mapper.gaussians.size], information)
    assert mapper.voxels.version > voxels

    turned = mapper.integrate(smooth_wall(np.radians(20.0), 2), may_thin=True)
    assert not turned.thinned
    # Without leave to thin, every frame is learnt: a lockstep mission has paid for all of them.
    assert not mapper.integrate(smooth_wall(np.radians(20.0), 3)).thinned


def test_the_time_of_a_thinned_frame_goes_to_keyframes(tmp_path: Path) -> None:
    config = MappingConfig(current_frame_share=1.0, replay_share=0.0)
    mapper = empty_mapper(config, tmp_path)
    mapper.integrate(smooth_wall(0.0, 0))
    mapper.keyframes = Watched(mapper.keyframes)
    mapper.optimise(interrupted=lambda: False, time_left=counted(5))
    assert mapper.keyframes.loads == 0
    assert mapper.integrate(smooth_wall(0.0, 1), may_thin=True).thinned
    mapper.optimise(interrupted=lambda: False, time_left=counted(5))
    assert mapper.keyframes.loads == 5


def test_a_restored_mapper_goes_on_alike(tmp_path: Path) -> None:
    config = MappingConfig(iterations_per_s=6.25)
    mapper, other = empty_mapper(config, tmp_path), empty_mapper(config, tmp_path)
    for number in range(2):
        mapper.integrate(wall_ahead(0.5 * number, number))
        mapper.optimise(interrupted=lambda: False)
    other.restore(pickle.loads(pickle.dumps(mapper.state())), keyframe_folder=tmp_path)
    for one in (mapper, other):
        one.integrate(wall_ahead(1.0, 2))
        assert one.optimise(interrupted=lambda: False) == 3
    size = mapper.gaussians.size
    np.testing.assert_array_equal(mapper.gaussians.parameters[:size], other.gaussians.parameters[:size])


def test_prune_drops_what_is_faint_or_floats(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(iterations_per_s=0), tmp_path)
    mapper.integrate(wall_ahead(0.3, 0))
    rng = np.random.default_rng(0)
    scattered = mapper.gaussians.parameters[: mapper.gaussians.size].copy()
    scattered[:, CENTRE] += rng.normal(0.0, 0.5, (len(scattered), 3))
    scattered[:, LOGIT_OPACITY] = rng.normal(0.0, 4.0, len(scattered))
    mapper.gaussians.append(scattered, anchor_keyframe=0)
    worth = worth_keeping(mapper)
    assert 0.2 < worth.mean() < 0.9
    expected = mapper.gaussians.parameters[: mapper.gaussians.size][worth]
    assert mapper.prune() == np.count_nonzero(~worth)
    np.testing.assert_array_equal(mapper.gaussians.parameters[: mapper.gaussians.size], expected)


def test_few_to_prune_are_hidden_until_there_are_more(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(iterations_per_s=0), tmp_path)
    mapper.integrate(wall_ahead(0.3, 0))
    size = mapper.gaussians.size
    mapper.gaussians.parameters[:5, CENTRE] = (0.3, 0.05, 1.0)
    mapper.gaussians.parameters[5:8, LOGIT_OPACITY] = -6.0
    version = mapper.gaussians.version
    assert mapper.prune(compact_share=0.5) == 0
    assert mapper.gaussians.size == size
    assert mapper.gaussians.version > version
    assert mapper.gaussians.opacities[:8].max() < 1e-6
    assert mapper.gaussians.opacities[8:].min() > 0.5
    assert mapper.prune(compact_share=7.5 / size) == 8
    assert mapper.gaussians.opacities.min() > 0.5


def test_steps_cannot_be_shared_out_twice() -> None:
    with pytest.raises(ValidationError, match=r"current_frame_share 0\.7 and replay_share 0\.4"):
        MappingConfig(current_frame_share=0.7, replay_share=0.4)


def test_a_map_of_discs_learns_the_same_wall(tmp_path: Path) -> None:
    """Optimised, pruned, saved and restored as discs; they lie on the wall and show its colours."""
    mapper = empty_mapper(MappingConfig(primitive="disc"), tmp_path / "keyframes")
    for number in range(4):
        mapper.integrate(smooth_wall(0.0, number))
        mapper.optimise(interrupted=lambda: False)
    gaussians = mapper.gaussians
    assert gaussians.primitive == "disc"
    assert gaussians.size > 100
    np.testing.assert_allclose(np.linalg.norm(gaussians.normals[: gaussians.size], axis=1), 1.0, atol=1e-5)
    last = smooth_wall(0.0, 4)
    report = mapper.integrate(last)
    assert report.psnr_predicted_db > 35.0
    seen = render(gaussians, last.intrinsics, last.T_world_camera)
    assert np.median(np.abs(seen.depth_m - last.depth_m)) < 0.002
    mapper.prune()
    again = empty_mapper(MappingConfig(primitive="disc"), tmp_path / "others")
    again.restore(pickle.loads(pickle.dumps(mapper.state())), keyframe_folder=tmp_path / "keyframes")
    size = mapper.gaussians.size
    assert again.gaussians.primitive == "disc"
    np.testing.assert_array_equal(again.gaussians.normals[:size], mapper.gaussians.normals[:size])


def test_an_unknown_primitive_is_refused() -> None:
    with pytest.raises(ValidationError, match=r"isotropic.*disc"):
        MappingConfig.model_validate({"primitive": "cube"})
