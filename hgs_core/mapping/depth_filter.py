"""From a noisy frame to a halved image with smooth depth."""

from __future__ import annotations

import numpy as np

from hgs_core.mapping.config import DepthFusionConfig
from hgs_core.mapping.keyframes import TrainingImage, halved_camera
from hgs_core.native import kernels
from hgs_core.sensing.frame import Frame

_HALVING_EDGE_M = 0.1


def training_image(frame: Frame, config: DepthFusionConfig) -> TrainingImage:
    """Half the resolution, with edge-aware smoothed depth.

    Depth: 2 x 2 mean within an edge, then a mean of inverse depth over pairs of opposite pixels that agree
    with a plane through the centre. On planes this is unbiased however slanted they are.
    """
    height, width = frame.depth_m.shape[0] // 2, frame.depth_m.shape[1] // 2
    rgb = np.empty((height, width, 3), np.uint8)
    halved = np.empty((height, width), np.float32)
    smoothed = np.empty((height, width), np.float32)
    kernels.halve_frame(
        np.ascontiguousarray(frame.rgb), np.ascontiguousarray(frame.depth_m), _HALVING_EDGE_M, rgb, halved
    )
    kernels.smooth_depth(halved, config.smoothing_radius_px, config.smoothing_gate_m, smoothed)
    return TrainingImage(
        rgb=rgb,
        depth_m=smoothed,
        intrinsics=halved_camera(frame.intrinsics),
        T_world_camera=frame.T_world_camera,
    )
