"""Both gains of many viewpoints at once, without rendering."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64
from numpy import ndarray

from hgs_core.gain.adaptive import adaptive_gains
from hgs_core.gain.coverage import coverage_by_yaw, surface_by_layer
from hgs_core.gain.field import GainField
from hgs_core.gain.panorama import PanoramaGrid, Panoramas, in_window, march
from hgs_core.gain.quality import FisherField, RaySample, as_area
from hgs_core.gain.viewpoint import (
    CoverageMeasure,
    GainConfig,
    GainPanorama,
    SurfaceInView,
    ViewGains,
)
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot


class PanoramaGainEvaluator:
    """Scores viewpoints along the rays of panoramas.

    Coverage marches each direction of the full circle through the voxels, quality scores a sample of the
    directions exactly; every yaw is a window over them. The maps are gathered into fields for it first:
    around the viewpoints only (Gaussians where some ray of
    the coverage comes), and once as long as the maps stay as they are.

    A ray reaches `range_m` of *horizontal* distance. A camera of that range in z-depth sees a little farther
    towards the sides of its image: the gains are slightly cautious there.
    """

    def __init__(self, config: GainConfig, intrinsics: CameraIntrinsics, range_m: float) -> None:
        self.config = config
        self._range_m = range_m
        self._camera = intrinsics
        self._grid = PanoramaGrid.for_camera(
            intrinsics, n_azimuths=config.azimuth_bins, n_elevations=config.elevation_bins
        )
        self._window = self._grid.window()
        self._sample = RaySample.for_camera(
            intrinsics, n_azimuths=config.azimuth_bins, n_elevations=config.quality_elevation_bins
        )
        self._field: GainField | None = None
        self._fisher: FisherField | None = None
        self._field_of: MapSnapshot | None = None
        self._fullness: Float32[ndarray, " nz"] | None = None
        """`surface` coverage alone: see `surface_by_layer`."""

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        """See `GainEvaluator`."""
        panoramas = self._marched(snapshot, positions_m)
        coverage = coverage_by_yaw(
            self._window,
            panoramas,
            self.config.coverage_measure,
            voxel_volume_m3=snapshot.voxels.config.size_m**3,
            pixels_per_ray=self._grid.pixels_per_ray,
        )
        if coverage_only and self.config.use_coverage:
            quality = np.zeros_like(coverage)
        else:
            scores = self._quality(snapshot, positions_m, panoramas.entered)
            field = self._field_over(snapshot)
            near = field.chunks_near(positions_m, self._range_m)
            quality = as_area(scores, gaussians_per_m2=field.gaussians_per_m2(near))
        return adaptive_gains(
            self.config, self._grid.yaws_rad, coverage, quality, observed_share=observed_share
        )

    def new_surface_in_view(
        self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"], yaws_rad: Float[ndarray, " n"]
    ) -> list[SurfaceInView]:
        """See `LocatingEvaluator`."""
        panoramas = self._marched(snapshot, positions_m)
        yaws = np.round((yaws_rad + np.pi) / self._grid.azimuth_step_rad).astype(np.int64)
        area = panoramas.new_surface_m2 * in_window(self._window, yaws % self._grid.n_azimuths)
        shape = snapshot.voxels.states.shape
        edge = max(1, round(self.config.locating_cube_m / snapshot.voxels.config.size_m))
        in_view = []
        for first, weights in zip(panoramas.first_unseen, area, strict=True):
            seen = (first >= 0) & (weights > 0)
            voxels = np.stack(np.unravel_index(first[seen], shape))
            cubes = np.ravel_multi_index(tuple(voxels // edge), shape)
            found, index = np.unique(cubes, return_inverse=True)
            in_view.append(
                SurfaceInView(cubes=found, area_m2=np.bincount(index, weights[seen]).astype(np.float64))
            )
        return in_view

    def panorama(self, snapshot: MapSnapshot, position_m: Float[ndarray, " 3"]) -> GainPanorama:
        """See `Panoramic`."""
        positions = position_m[None]
        seen = self._marched(snapshot, positions)
        by_surface = self.config.coverage_measure is CoverageMeasure.SURFACE
        rays = np.zeros((self._sample.grid.n_elevations, self._sample.grid.n_azimuths), np.float32)
        if self._fisher is not None:
            self._fisher.gather(snapshot, seen.entered)
            rays = self._fisher.scores(self._sample, snapshot, positions)[0].sum(axis=-1)
        return GainPanorama(
            coverage=(seen.new_surface_m2 if by_surface else seen.unseen_volume_m3)[0],
            quality=rays,
            tan_low=self._grid.tan_low,
            tan_high=self._grid.tan_high,
        )

    def _marched(self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"]) -> Panoramas:
        field = self._field_over(snapshot)
        by_surface = self.config.coverage_measure is CoverageMeasure.SURFACE
        field.gather(
            snapshot,
            field.chunks_near(positions_m, self._range_m),
            fullness=self._fullness if by_surface else None,
        )
        return march(
            self._grid,
            field,
            positions_m,
            range_m=self._range_m,
            free_path_m=self.config.free_path_m if by_surface else np.inf,
        )

    def _quality(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        in_sight: Bool[ndarray, "n_chunks_x n_chunks_y"],
    ) -> Float64[ndarray, "n n_yaws"]:
        if self._fisher is None:
            return np.zeros((len(positions_m), self._grid.n_azimuths))
        self._fisher.gather(snapshot, in_sight)
        return self._fisher.score_by_yaw(self._sample, snapshot, positions_m)

    def _field_over(self, snapshot: MapSnapshot) -> GainField:
        """The fields of the snapshot's maps, as far as they have been gathered."""
        is_new = not snapshot.is_same(self._field_of)
        if self._field is None or not self._field.is_over(snapshot.voxels):
            self._field = GainField.over(snapshot.voxels)
            if self.config.use_quality and snapshot.voxels.states.size:
                self._fisher = FisherField(
                    snapshot.voxels,
                    self._camera,
                    prior_information=self.config.prior_information,
                    saturation_m=self.config.quality_saturation_m,
                    range_m=self._range_m,
                )
        elif is_new:
            self._field.is_gathered[:] = False
            if self._fisher is not None:
                self._fisher.forget()
        if is_new and self.config.coverage_measure is CoverageMeasure.SURFACE:
            self._fullness = surface_by_layer(snapshot.voxels, free_path_m=self.config.free_path_m)
        self._field_of = snapshot
        return self._field


def build(config: GainConfig, camera: CameraIntrinsics, range_m: float) -> PanoramaGainEvaluator:
    """For the registry."""
    return PanoramaGainEvaluator(config, camera, range_m)
