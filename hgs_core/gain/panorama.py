"""Cylindrical panoramas: all directions once, then any yaw of the camera as a window over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Float32, Float64
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.gain.field import GainField
from hgs_core.geometry.camera import CameraIntrinsics

OPAQUE_BELOW: Final = 0.01
"""A ray ends where less than this is left of it."""

FACE_GAP_VOXELS: Final = 1.0
"""Opaque voxels that lie no farther apart along a ray are one face, which does not hide its own Gaussians."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PanoramaGrid:
    """The directions of a panorama for a level camera.

    Columns are azimuths: bin `a` covers `[-pi + a d, -pi + (a + 1) d)`, `d = azimuth_step_rad`. Rows are
    tangents of the elevation, evenly spaced over the camera's vertical field of view, so that a level
    pinhole's image rows at azimuth `delta` off its axis are rows here, shrunk by `cos(delta)`.
    """

    n_azimuths: int
    n_elevations: int
    tan_low: float
    tan_high: float
    visible: Float64[ndarray, "n_elevations n_azimuths"]
    """`visible[e, m]`: share of a bin that the camera sees when its axis points at the lower edge of the bin
    `m` places before it."""
    visible_over_z2: Float64[ndarray, "n_elevations n_azimuths"]
    """The same, weighted with (horizontal distance / z-depth)^2 = 1 / cos^2(delta)."""
    pixels_per_ray: float
    """Image pixels for each ray of the panorama that the camera sees."""

    @property
    def azimuth_step_rad(self) -> float:
        return 2 * np.pi / self.n_azimuths

    @property
    def yaws_rad(self) -> Float[ndarray, " n_yaws"]:
        """The yaws of the sliding window: the lower edges of the azimuth bins."""
        yaws: Float[ndarray, " n_yaws"] = -np.pi + self.azimuth_step_rad * np.arange(self.n_azimuths)
        return yaws

    @staticmethod
    def for_camera(camera: CameraIntrinsics, *, n_azimuths: int, n_elevations: int) -> PanoramaGrid:
        """The panorama of all pixels of `camera`, its optical axis level."""
        tan_high = camera.cy / camera.fy
        tan_low = (camera.cy - camera.height) / camera.fy
        rows = tan_low + (np.arange(n_elevations) + 0.5) * (tan_high - tan_low) / n_elevations
        # A row is visible while it has not sunk under the image's edge: |u| <= |u_edge| cos(delta).
        widest = np.arccos(np.clip(np.where(rows > 0, rows / tan_high, rows / tan_low), 0.0, 1.0))
        left = np.minimum(np.arctan(camera.cx / camera.fx), widest)
        right = -np.minimum(np.arctan((camera.width - camera.cx) / camera.fx), widest)

        step = 2 * np.pi / n_azimuths
        lower = np.arange(n_azimuths) * step
        lower = np.where(lower >= np.pi - step / 4, lower - 2 * np.pi, lower)
        first = np.clip(lower[None, :], right[:, None], left[:, None])
        last = np.clip(lower[None, :] + step, right[:, None], left[:, None])
        visible = (last - first) / step
        return PanoramaGrid(
            n_azimuths=n_azimuths,
            n_elevations=n_elevations,
            tan_low=tan_low,
            tan_high=tan_high,
            visible=visible,
            visible_over_z2=(np.tan(last) - np.tan(first)) / step,
            pixels_per_ray=camera.width * camera.height / float(visible.sum()),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Panoramas:
    """What `n` viewpoints see in each direction."""

    unseen_volume_m3: Float32[ndarray, "n n_elevations n_azimuths"]
    """Unobserved volume, weighted with the transmittance before it."""
    unseen_voxels: Float32[ndarray, "n n_elevations n_azimuths"]
    """Unobserved voxels on the direction's ray, weighted likewise (the sum of Eq. 4 without `V`)."""
    quality: Float32[ndarray, "n n_elevations n_azimuths"]
    """Sum of information ratios (Eq. 9), as if z-depth were horizontal distance."""


def march(
    grid: PanoramaGrid,
    field: GainField,
    positions_m: Float[ndarray, "n 3"],
    *,
    range_m: float,
    saturation_m: float = 0.0,
) -> Panoramas:
    """March every direction of every viewpoint through the field, up to `range_m` of horizontal distance.

    Nearer than `saturation_m` a surface's quality gains no more than from there.
    """
    size_m = field.size_m
    shape = (len(positions_m), grid.n_elevations, grid.n_azimuths)
    volume, voxels, quality = (np.zeros(shape, np.float32) for _ in range(3))
    if field.cells.size:
        kernels.march_panoramas(
            field.cells,
            np.ascontiguousarray(positions_m / size_m - field.first_index, np.float64),
            grid.tan_low,
            grid.tan_high,
            range_m / size_m,
            OPAQUE_BELOW,
            saturation_m / size_m,
            FACE_GAP_VOXELS,
            volume,
            voxels,
            quality,
        )
    # The kernel measures in voxels: volume in voxels, quality for distances in voxels.
    return Panoramas(
        unseen_volume_m3=volume * np.float32(size_m**3),
        unseen_voxels=voxels,
        quality=quality / np.float32(size_m**2),
    )


def by_yaw(
    panoramas: Float32[ndarray, "n n_elevations n_azimuths"],
    window: Float64[ndarray, "n_elevations n_azimuths"],
) -> Float64[ndarray, "n n_azimuths"]:
    """Slide a window over the panoramas: `sum_em window[e, m] panorama[e, k + m]` for yaw `k`."""
    sums = np.zeros((len(panoramas), window.shape[1]))
    kernels.slide_window(panoramas, window, sums)
    return sums
