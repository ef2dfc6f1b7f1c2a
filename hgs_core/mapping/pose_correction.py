"""What a correction of keyframe poses does to the maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hgs_core.errors import MapError
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframes import KeyframeStore
from hgs_core.mapping.scan_log import ScanLog
from hgs_core.sensing.frame import Frame
from hgs_core.voxels.voxel_map import VoxelMap


@dataclass(frozen=True, kw_only=True)
class CorrectionReport:
    """What one correction did."""

    keyframes: int
    """That were moved."""
    gaussians: int
    """That moved with them."""
    observed_before: int
    """Voxels that were not unobserved."""
    observed_after: int
    """Once built anew: what only frames between keyframes saw is unobserved again."""


def motions_of(corrected: Mapping[int, SE3], keyframes: KeyframeStore) -> dict[int, SE3]:
    """How each keyframe moves in the world: its new pose after the inverse of its old one.

    Raises `MapError` for a keyframe that there is not, and for a map that another run began.
    """
    unknown = sorted(index for index in corrected if not 0 <= index < len(keyframes))
    if unknown:
        raise MapError(f"no keyframe {unknown[0]} to correct; there are {len(keyframes)}, from 0")
    if keyframes.inherited:
        raise MapError(
            "this map goes on from another run's, whose scans are not kept: its voxels cannot be built anew, "
            "so its poses cannot be corrected"
        )
    poses = keyframes.poses
    return {index: pose @ poses[index].inverse() for index, pose in corrected.items()}


def rebuilt_voxels(
    voxels: VoxelMap,
    keyframes: KeyframeStore,
    scans: ScanLog,
    *,
    camera_range_m: float,
    scanner_range_m: float,
) -> VoxelMap:
    """The voxels that the keyframes' depth and all scans show, from where they stand now.

    Costs about a millisecond of reading and as much of integrating for each keyframe.
    """
    anew = voxels.begun_anew()
    stride = max(1, voxels.config.pixel_stride // 2)
    for index in range(len(keyframes)):
        image = keyframes.load(index)
        frame = Frame(
            rgb=image.rgb,
            depth_m=image.depth_m,
            intrinsics=image.intrinsics,
            T_world_camera=image.T_world_camera,
            timestamp_s=0.0,
            sequence=index,
        )
        # Keyframe images have half the pixels a side: half the stride gives as many rays.
        anew.integrate_frame(frame, range_m=camera_range_m, pixel_stride=stride)
        for scan in scans.of_keyframe(index):
            anew.integrate_scan(scan, range_m=scanner_range_m)
    anew.note_change()
    return anew
