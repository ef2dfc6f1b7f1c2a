"""A mapper that has seen nothing."""

from pathlib import Path

import numpy as np

from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.mapper import Mapper
from hgs_core.voxels.voxel_map import VoxelConfig


def empty_mapper(config: MappingConfig, keyframe_folder: Path, *, correctable: bool = False) -> Mapper:
    return Mapper(
        config,
        VoxelConfig(),
        camera_range_m=5.0,
        scanner_range_m=5.0,
        region=None,
        keyframe_folder=keyframe_folder,
        rng=np.random.default_rng(0),
        correctable=correctable,
    )
