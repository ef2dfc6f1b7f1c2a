"""Shares of a level camera's image at every yaw, from voxels alone: what stands in for rendering candidates.

One panorama holds all yaws of a place and takes about a millisecond; drawing the Gaussian map for one yaw
takes 17 ms even at 75 x 43 pixels (570 000 Gaussians, one core), since every Gaussian in range is projected
whatever the resolution. A pool of hundreds of candidate views a cycle needs the former.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Float64
from numpy import ndarray

from hgs_core.gain.field import UNSEEN, GainField
from hgs_core.gain.panorama import PanoramaGrid, Panoramas, by_yaw, march
from hgs_core.gain.viewpoint import GainConfig, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot

PIXELS_POWER = 3
"""A flat image has `1 / cos^3` as many pixels in a direction off its axis as on it."""


class VoxelPanoramas:
    """Marches panoramas through a snapshot's voxels, which it gathers once as long as they stay the same."""

    def __init__(self, config: GainConfig, camera: CameraIntrinsics, range_m: float) -> None:
        self.range_m = range_m
        self.grid = PanoramaGrid.for_camera(
            camera, n_azimuths=config.azimuth_bins, n_elevations=config.elevation_bins
        )
        self._volume_window = self.grid.window()
        pixels = self.grid.window(PIXELS_POWER)
        self._pixel_window = pixels / pixels.sum()
        self._field: GainField | None = None
        self._field_of: MapSnapshot | None = None

    def unseen(self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"]) -> Panoramas:
        """Unobserved space in each direction, as in the coverage gain."""
        return march(self.grid, self._gathered(snapshot, positions_m), positions_m, range_m=self.range_m)

    def marked(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        marked: Bool[ndarray, "nx ny nz"],
    ) -> Panoramas:
        """The same for marked voxels in place of unobserved ones."""
        field = self._gathered(snapshot, positions_m)
        cells = field.cells.copy()
        cells[..., UNSEEN] = marked
        return march(self.grid, replace(field, cells=cells), positions_m, range_m=self.range_m)

    def volume_m3(self, panoramas: Panoramas) -> Float64[ndarray, "n n_yaws"]:
        """Volume in view at each yaw."""
        return by_yaw(panoramas.unseen_volume_m3, self._volume_window)

    def share_of_image(
        self, rays: Float[ndarray, "n n_elevations n_azimuths"]
    ) -> Float64[ndarray, "n n_yaws"]:
        """The mean of `rays` over the image's pixels at each yaw."""
        return by_yaw(np.ascontiguousarray(rays, np.float32), self._pixel_window)

    def _gathered(self, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"]) -> GainField:
        field, of = self._field, self._field_of
        if (
            field is None
            or of is None
            or of.version != snapshot.version
            or of.voxels is not snapshot.voxels
            or of.gaussians is not snapshot.gaussians
            or not field.is_over(snapshot.voxels)
        ):
            field = GainField.over(snapshot.voxels)
        field.gather(snapshot, field.chunks_near(positions_m, self.range_m))
        self._field, self._field_of = field, snapshot
        return field


def as_gains(
    yaws_rad: Float[ndarray, " n_yaws"],
    explore: Float64[ndarray, "n n_yaws"],
    exploit: Float64[ndarray, "n n_yaws"],
    total: Float64[ndarray, "n n_yaws"],
) -> ViewGains:
    """A method's own measures as gains: exploration in the place of coverage, exploitation in that of
    quality."""
    best = np.argmax(total, axis=1)
    rows = np.arange(len(total))
    return ViewGains(
        yaws_rad=yaws_rad,
        coverage_by_yaw=explore,
        quality_by_yaw=exploit,
        total_by_yaw=total,
        coverage=explore[rows, best],
        quality=exploit[rows, best],
        total=total[rows, best],
        best_yaw_rad=yaws_rad[best],
    )
