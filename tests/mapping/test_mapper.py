"""The mapper's share-out of optimisation steps."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import MappingConfig
from hgs_core.sensing.frame import Frame
from tests.mapping.new_mapper import empty_mapper

CAMERA = CameraIntrinsics.centred(120, 80, 60.0)


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


def test_steps_cannot_be_shared_out_twice() -> None:
    with pytest.raises(ValidationError, match=r"current_frame_share 0\.7 and replay_share 0\.4"):
        MappingConfig(current_frame_share=0.7, replay_share=0.4)
