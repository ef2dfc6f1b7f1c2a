"""The mapper's share-out of optimisation steps, and its pruning."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.ndimage import binary_dilation

from hgs_core.gaussians.gaussian_map import CENTRE, LOGIT_OPACITY
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import MappingConfig
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


@pytest.mark.parametrize(("replay_share", "is_replayed"), [(0.0, False), (0.5, True)])
def test_what_is_out_of_view_is_optimised_on_only_by_replay(
    replay_share: float, is_replayed: bool, tmp_path: Path
) -> None:
    mapper = empty_mapper(MappingConfig(replay_share=replay_share, iterations_per_frame=20), tmp_path)
    mapper.integrate(wall_ahead(0.0, 0), interrupted=lambda: False)
    behind = mapper.gaussians.size
    steps = mapper.gaussians.adam_steps[:behind].copy()
    mapper.integrate(wall_ahead(np.pi, 1), interrupted=lambda: False)
    assert mapper.gaussians.size > behind
    assert bool(np.any(mapper.gaussians.adam_steps[:behind] > steps)) == is_replayed


def test_prune_drops_what_is_faint_or_floats(tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(iterations_per_frame=0), tmp_path)
    mapper.integrate(wall_ahead(0.3, 0), interrupted=lambda: False)
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
    mapper = empty_mapper(MappingConfig(iterations_per_frame=0), tmp_path)
    mapper.integrate(wall_ahead(0.3, 0), interrupted=lambda: False)
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
