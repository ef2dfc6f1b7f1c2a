"""The mapper on a real RGB-D recording: noise, holes, and colour that is not quite registered to depth."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.gaussians.render import render
from hgs_core.mapping.config import MappingConfig
from hgs_core.sensing.recording import RecordedSequence
from hgs_core.voxels.voxel_map import VoxelState
from tests.mapping.new_mapper import empty_mapper


@pytest.fixture
def sequence(shared_dir: Path) -> RecordedSequence:
    folder = shared_dir / "rgbd" / "seven_scenes_excerpt"
    if not folder.is_dir():
        pytest.skip(f"no recording at {folder}")
    return RecordedSequence(folder)


def test_a_recording_becomes_a_map(sequence: RecordedSequence, tmp_path: Path) -> None:
    mapper = empty_mapper(MappingConfig(iterations_per_s=15), tmp_path)
    frames = [frame for number, frame in enumerate(sequence) if number < 24]
    predicted = []
    for frame in frames[::2]:
        predicted.append(mapper.integrate(frame).psnr_predicted_db)
        mapper.optimise(interrupted=lambda: False)
    # Each frame is foretold before it is learnt: a map that fits a real room does so recognisably.
    assert np.nanmedian(predicted[2:]) > 18.0
    held_out = frames[13]
    view = render(mapper.gaussians, held_out.intrinsics, held_out.T_world_camera)
    measured = (held_out.depth_m > 0) & np.isfinite(held_out.depth_m) & (view.silhouette > 0.5)
    assert measured.mean() > 0.5
    error = np.abs(view.depth_m - held_out.depth_m)[measured]
    assert np.median(error) < 0.03
    states = mapper.voxels.states
    assert np.count_nonzero(states == VoxelState.FREE) > np.count_nonzero(states == VoxelState.OCCUPIED) > 500
