"""Both gains of many viewpoints at once, without rendering."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32
from numpy import ndarray

from hgs_core.gain.adaptive import adaptive_gains
from hgs_core.gain.coverage import coverage_by_yaw
from hgs_core.gain.field import GainField
from hgs_core.gain.panorama import PanoramaGrid, Panoramas, march
from hgs_core.gain.quality import quality_by_yaw, sampled_quality
from hgs_core.gain.viewpoint import GainConfig, QualityMeasure, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot


class PanoramaGainEvaluator:
    """Scores viewpoints by marching panoramas through the voxels around them.

    Gaussians are gathered into the voxels first (see `GainField`); one march of each viewpoint's full circle
    then yields both gains, and every yaw is a window over it. The cost does not depend on the number of
    Gaussians, but for gathering them: around the viewpoints only, and once as long as the maps stay as they
    are.

    A ray reaches `range_m` of *horizontal* distance. A camera of that range in z-depth sees a little farther
    towards the sides of its image: the gains are slightly cautious there.
    """

    def __init__(self, config: GainConfig, intrinsics: CameraIntrinsics, range_m: float) -> None:
        self.config = config
        self._range_m = range_m
        self._camera = intrinsics
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
        field = self._field_over(snapshot)
        near = field.chunks_near(positions_m, self._range_m)
        field.gather(snapshot, near, prior_information=self.config.prior_information, focal_px=self._focal_px)
        panoramas = march(
            self._grid,
            field,
            positions_m,
            range_m=self._range_m,
            saturation_m=self.config.quality_saturation_m,
        )
        coverage = coverage_by_yaw(
            self._grid, panoramas, self.config.coverage_measure, voxel_volume_m3=field.size_m**3
        )
        quality = quality_by_yaw(
            self._grid,
            self._quality(snapshot, positions_m, panoramas),
            gaussians_per_m2=field.gaussians_per_m2(near),
        )
        return adaptive_gains(
            self.config, self._grid.yaws_rad, coverage, quality, observed_share=observed_share
        )

    def _quality(
        self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"], panoramas: Panoramas
    ) -> Float32[ndarray, "n n_elevations n_azimuths"]:
        if not self.config.use_quality or self.config.quality_measure is QualityMeasure.MODEL:
            return panoramas.quality
        return sampled_quality(
            self._grid,
            snapshot.gaussians,
            positions_m,
            prior_information=self.config.prior_information,
            camera=self._camera,
            range_m=self._range_m,
            saturation_m=self.config.quality_saturation_m,
        )

    def _field_over(self, snapshot: MapSnapshot) -> GainField:
        """The field of the snapshot's maps, as far as it has been gathered."""
        if self._field is None or not self._field.is_over(snapshot.voxels):
            self._field = GainField.over(snapshot.voxels)
        elif not self._is_of(snapshot):
            self._field.is_gathered[:] = False
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
