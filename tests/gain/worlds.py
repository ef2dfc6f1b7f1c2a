"""Small made-up maps: rooms of voxels, walls of Gaussians."""

import numpy as np
from numpy import ndarray

from hgs_core.gain.evaluator import PanoramaGainEvaluator
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

CAMERA = CameraIntrinsics.centred(1200, 680, 600.0)


def empty_voxels(size_m: tuple[float, float, float]) -> VoxelMap:
    """Unobserved everywhere, with the lower corner at the origin."""
    return VoxelMap(VoxelConfig(), region=Box(lower_m=np.zeros(3), upper_m=np.array(size_m)))


def closed_room(size_m: tuple[float, float, float] = (4.0, 4.0, 2.5), *, margin: int = 8) -> VoxelMap:
    """An observed empty room with walls one voxel thick, unobserved space all around it."""
    voxels = empty_voxels(size_m)
    inner = (slice(margin, -margin),) * 2 + (slice(2, -2),)
    voxels.states[inner] = VoxelState.OCCUPIED
    inside = (slice(margin + 1, -margin - 1),) * 2 + (slice(3, -3),)
    voxels.states[inside] = VoxelState.FREE
    voxels.note_change()
    return voxels


def gaussians_at(centres_m: ndarray, *, information: float = 10.0, radius_m: float = 0.012) -> GaussianMap:
    """Opaque Gaussians of many colours."""
    n = len(centres_m)
    parameters = np.zeros((n, 8), np.float32)
    parameters[:, :3] = centres_m
    parameters[:, 3:6] = np.random.default_rng(0).uniform(0.0, 1.0, (n, 3))
    parameters[:, 6] = np.log(radius_m)
    parameters[:, 7] = 3.0
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    gaussians.information[:n] = information
    return gaussians


def on_surfaces(voxels: VoxelMap, per_voxel: int, rng: np.random.Generator) -> ndarray:
    """Points spread over the occupied voxels."""
    occupied = voxels.centres_m(np.argwhere(voxels.states == VoxelState.OCCUPIED))
    points = np.repeat(occupied, per_voxel, axis=0)
    return points + rng.uniform(-0.049, 0.049, points.shape)


def snapshot_of(voxels: VoxelMap, gaussians: GaussianMap | None = None) -> MapSnapshot:
    gaussians = gaussians if gaussians is not None else GaussianMap()
    return MapSnapshot(
        gaussians=gaussians, voxels=voxels, version=voxels.version + gaussians.version, timestamp_s=0.0
    )


def evaluator(range_m: float = 5.0, **config: object) -> PanoramaGainEvaluator:
    return PanoramaGainEvaluator(GainConfig(**config), CAMERA, range_m)
