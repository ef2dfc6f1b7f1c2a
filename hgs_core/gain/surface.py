"""Surface coverage: how much surface a view would cover that no view has covered yet (TARE's reward).

Cao, Zhu, Choset and Zhang, "TARE: A Hierarchical Framework for Efficiently Exploring Complex 3D
Environments", RSS 2021; "Representation Granularity Enables Time-Efficient Autonomous Exploration in Large,
Complex Worlds", Science Robotics 2023. As the gain of the hierarchical planner, which has TARE's two levels,
it is HGS-Planner's variant V1.

Kept of the original:
- surface is the border between free and not-free space, what is beyond unknown or occupied;
- a view covers what it sees within a distance, at a bounded angle off the surface's normal, with nothing
  before it; what it newly covers is its reward, in square metres;
- surface is thinned to patches before views are scored (TARE: to points 0.3 to 0.5 m apart).

Not kept:
- TARE marks what each pose of the robot has covered. A gain sees the maps alone, so what has been covered is
  read off them: unknown space beyond the border means that it has not; occupied voxels are covered when their
  Gaussians' colour information (pixels that have shown them) amounts to one look from the greatest distance
  at the greatest angle;
- TARE's lidar sees all around. This camera has a field of view: each yaw has its reward;
- TARE lowers the rewards of views by what views chosen with them cover already; the hierarchical planner
  scores each by itself, and again on its way there.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import uniform_filter

from hgs_core.gain.adaptive import at_best_yaws
from hgs_core.gain.by_voxel import colour_information, sums_by_voxel
from hgs_core.gain.panorama import PanoramaGrid
from hgs_core.gain.sight import SightLimits, Targets, seen_by_yaw
from hgs_core.gain.viewpoint import GainConfig, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

_SHARED: Final = 0.25
"""What is left of a pixel as information, where its colour is blended from about four Gaussians."""


class SurfaceGainEvaluator:
    """Scores viewpoints by the surface that they newly cover; its coverage is in square metres."""

    def __init__(self, config: GainConfig, camera: CameraIntrinsics, range_m: float) -> None:
        self.config = config
        self._grid = PanoramaGrid.for_camera(
            camera, n_azimuths=config.azimuth_bins, n_elevations=config.elevation_bins
        )
        far_m = min(config.surface_distance_m, range_m)
        incidence = float(np.radians(config.surface_incidence_deg))
        self._limits = SightLimits(near_m=0.0, far_m=far_m, max_incidence_rad=incidence)
        self._pixels_per_m2 = camera.fx * camera.fy * np.cos(incidence) / far_m**2
        self._patches: Targets | None = None
        self._patches_of: MapSnapshot | None = None

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        """See `GainEvaluator`; the observed share weighs quality, of which there is none here."""
        patches = self._patches
        if patches is None or not snapshot.is_same(self._patches_of):
            patches = self._patches = self.uncovered(snapshot)
            self._patches_of = snapshot
        voxels = snapshot.voxels
        not_free = voxels.states != VoxelState.FREE
        area = seen_by_yaw(self._grid, patches, voxels, not_free, positions_m, self._limits)
        total = area / self.config.surface_scale_m2
        return at_best_yaws(self._grid.yaws_rad, area, np.zeros_like(area), total)

    def uncovered(self, snapshot: MapSnapshot) -> Targets:
        """Patches of the surface that no view has covered, weighed by their area [m^2].

        Each lies in the middle of a free voxel beside one that is not, and its normal is that face's.
        """
        voxels = snapshot.voxels
        free = voxels.states == VoxelState.FREE
        open_ = voxels.missing() | ((voxels.states == VoxelState.OCCUPIED) & ~self._is_covered(snapshot))
        if voxels.interest is not None:
            open_ &= voxels.interest[..., None]
        points, areas, normals = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros((0, 3))]
        for axis in range(3):
            for sign in (-1, 1):
                faces = np.argwhere(free & _shifted(open_, axis, sign))
                middle, count = _thinned(faces, voxels, self.config.surface_patch_m)
                points.append(voxels.centres_m(faces[middle]))
                areas.append(count * voxels.config.size_m**2)
                normals.append(np.tile(np.eye(3)[axis] * sign, (len(middle), 1)))
        return Targets(
            points_m=np.concatenate(points), weights=np.concatenate(areas), normals=np.concatenate(normals)
        )

    def _is_covered(self, snapshot: MapSnapshot) -> Bool[ndarray, "nx ny nz"]:
        """Voxels of which the frames have shown as much as one look from the limits shows.

        Gaussians on plain surface may be farther apart than voxels: a voxel counts with its neighbours. On
        a plane, nine of the 27 hold surface.
        """
        voxels, gaussians = snapshot.voxels, snapshot.gaussians
        shown, _ = sums_by_voxel(voxels, gaussians, colour_information(gaussians))
        around = 3.0 * uniform_filter(shown, size=3, mode="constant")
        needed = _SHARED * self._pixels_per_m2 * voxels.config.size_m**2
        covered: Bool[ndarray, "nx ny nz"] = around >= needed
        return covered


def _shifted(mask: Bool[ndarray, "nx ny nz"], axis: int, sign: int) -> Bool[ndarray, "nx ny nz"]:
    """Voxels whose neighbour against `sign` along the axis is set: a face with its normal along `sign`."""
    ahead, behind = [slice(None)] * 3, [slice(None)] * 3
    ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
    if sign < 0:
        ahead, behind = behind, ahead
    shifted = np.zeros_like(mask)
    shifted[tuple(ahead)] = mask[tuple(behind)]
    return shifted


def _thinned(
    faces: Int[ndarray, "n 3"], voxels: VoxelMap, patch_m: float
) -> tuple[Int[ndarray, " m"], Int[ndarray, " m"]]:
    """One face of each cube of edge `patch_m` (as rows, the middle one), and how many faces each stands
    for."""
    cubes = np.floor(voxels.centres_m(faces) / patch_m).astype(np.int64)
    order = np.lexsort(cubes.T)
    begins = np.any(np.diff(cubes[order], axis=0, prepend=np.iinfo(np.int64).min // 2) != 0, axis=1)
    starts = np.flatnonzero(begins)
    counts = np.diff(starts, append=len(faces))
    return order[starts + counts // 2], counts


def build(config: GainConfig, camera: CameraIntrinsics, range_m: float) -> SurfaceGainEvaluator:
    """For the registry."""
    return SurfaceGainEvaluator(config, camera, range_m)
