"""Both gains of many viewpoints at once, without rendering."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.gain.adaptive import adaptive_gains
from hgs_core.gain.coverage import coverage_by_yaw
from hgs_core.gain.field import GainField, gain_field
from hgs_core.gain.panorama import PanoramaGrid, march
from hgs_core.gain.quality import quality_by_yaw
from hgs_core.gain.viewpoint import GainConfig, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap


class PanoramaGainEvaluator:
    """Scores viewpoints by marching panoramas through the voxels around them.

    Gaussians are gathered into the voxels first (see `gain_field`); one march of each viewpoint's full circle
    then yields both gains, and every yaw is a window over it. The cost does not depend on the number of
    Gaussians, but for gathering them. The maps are read around the viewpoints only; what was gathered is
    kept until the maps change or a viewpoint leaves it.

    A ray reaches `range_m` of *horizontal* distance. A camera of that range in z-depth sees a little farther
    towards the sides of its image: the gains are slightly cautious there.
    """

    def __init__(self, config: GainConfig, intrinsics: CameraIntrinsics, range_m: float) -> None:
        self.config = config
        self._range_m = range_m
        self._focal_px = float(np.sqrt(intrinsics.fx * intrinsics.fy))
        self._grid = PanoramaGrid.for_camera(
            intrinsics, n_azimuths=config.azimuth_bins, n_elevations=config.elevation_bins
        )
        self._field: GainField | None = None
        self._field_of: MapSnapshot | None = None

    def evaluate(
        self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"], *, observed_share: float
    ) -> ViewGains:
        """Gains of a camera at each position, level, all yaws. `observed_share` is lambda_o of Eq. 10."""
        size = snapshot.voxels.config.size_m
        field = self._field_around(snapshot, positions_m)
        panoramas = march(
            self._grid,
            field,
            positions_m,
            size_m=size,
            range_m=self._range_m,
            saturation_m=self.config.quality_saturation_m,
        )
        coverage = coverage_by_yaw(
            self._grid, panoramas, self.config.coverage_measure, voxel_volume_m3=size**3
        )
        quality = quality_by_yaw(self._grid, panoramas, gaussians_per_m2=field.gaussians_per_m2)
        return adaptive_gains(
            self.config, self._grid.yaws_rad, coverage, quality, observed_share=observed_share
        )

    def _field_around(self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"]) -> GainField:
        first, last = _box_around(snapshot.voxels, positions_m, self._range_m)
        if self._field is None or not self._is_of(snapshot) or not self._field.holds(first, last):
            self._field = gain_field(
                snapshot,
                first,
                last,
                prior_information=self.config.prior_information,
                focal_px=self._focal_px,
            )
            self._field_of = snapshot
        return self._field

    def _is_of(self, snapshot: MapSnapshot) -> bool:
        of = self._field_of
        return (
            of is not None
            and of.version == snapshot.version
            and of.gaussians is snapshot.gaussians
            and of.voxels is snapshot.voxels
        )


def _box_around(
    voxels: VoxelMap, positions_m: Float[ndarray, "n 3"], range_m: float
) -> tuple[Int[ndarray, " 3"], Int[ndarray, " 3"]]:
    """Global indices of the map's voxels within `range_m` of any position (half-open; all heights)."""
    size = voxels.config.size_m
    map_first, map_last = voxels.origin_index, voxels.origin_index + voxels.states.shape
    if len(positions_m) == 0:
        return map_first, map_first
    first, last = map_first.copy(), map_last.copy()
    near_first = np.floor((positions_m.min(axis=0) - range_m) / size).astype(np.int64)
    near_last = np.floor((positions_m.max(axis=0) + range_m) / size).astype(np.int64) + 1
    first[:2] = np.clip(near_first[:2], map_first[:2], map_last[:2])
    last[:2] = np.clip(near_last[:2], first[:2], map_last[:2])
    return first, last
