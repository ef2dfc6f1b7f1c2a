"""Cylindrical panoramas: all directions once, then any yaw of the camera as a window over them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int, Int32
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.gain.field import GainField
from hgs_core.geometry.camera import CameraIntrinsics

OPAQUE_BELOW: Final = 0.01
"""A ray ends where less than this is left of it."""


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
    first_rad: Float64[ndarray, "n_elevations n_azimuths"]
    """The part `[first_rad[e, m], last_rad[e, m]]` of a bin that the camera sees, as angles off its axis,
    when that points at the lower edge of the bin `m` places before it; empty where they are equal."""
    last_rad: Float64[ndarray, "n_elevations n_azimuths"]
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

    def window(self, power: int = 0) -> Float64[ndarray, "n_elevations n_azimuths"]:
        """The mean over each bin of `1 / cos(angle off the axis)^power` where the camera sees it, else 0.

        With power 0, the share of the bin that is seen.
        """
        nodes, weights = np.polynomial.legendre.leggauss(4)
        width = self.last_rad - self.first_rad
        angles = self.first_rad[..., None] + width[..., None] * (nodes + 1) / 2
        means: Float64[ndarray, "n_elevations n_azimuths"] = (np.cos(angles) ** -power) @ (weights / 2)
        return means * width / self.azimuth_step_rad

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
        seen_bins = float((last - first).sum()) / step
        return PanoramaGrid(
            n_azimuths=n_azimuths,
            n_elevations=n_elevations,
            tan_low=tan_low,
            tan_high=tan_high,
            first_rad=first,
            last_rad=last,
            pixels_per_ray=camera.width * camera.height / seen_bins,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Panoramas:
    """What `n` viewpoints see in each direction."""

    unseen_volume_m3: Float32[ndarray, "n n_elevations n_azimuths"]
    """Unobserved volume, weighted with the transmittance before it."""
    unseen_voxels: Float32[ndarray, "n n_elevations n_azimuths"]
    """Unobserved voxels on the direction's ray, weighted likewise (the sum of Eq. 4 without `V`)."""
    new_surface_m2: Float32[ndarray, "n n_elevations n_azimuths"]
    """Surface expected in unobserved space; 0 where that is taken to hide nothing."""
    first_unseen: Int32[ndarray, "n n_elevations n_azimuths"]
    """The first voxel of unobserved space on the direction's ray, as a flat index of the field's cells; -1
    for none."""
    entered: Bool[ndarray, "n_chunks_x n_chunks_y"]
    """The field's chunks that a ray came into, before it ended or as it did."""


def march(
    grid: PanoramaGrid,
    field: GainField,
    positions_m: Float[ndarray, "n 3"],
    *,
    range_m: float,
    free_path_m: float = np.inf,
) -> Panoramas:
    """March every direction of every viewpoint through the field, up to `range_m` of horizontal distance.

    `free_path_m` is how far light comes in unobserved space, in the mean; in a voxel that is `k` times as
    full of surface, a `k`-th of it. Unless it is infinite, as in Eq. 4, the other sums are weighted with what
    that leaves of the light, too.
    """
    size_m = field.size_m
    shape = (len(positions_m), grid.n_elevations, grid.n_azimuths)
    volume, voxels, surface = (np.zeros(shape, np.float32) for _ in range(3))
    first_unseen = np.full(shape, -1, np.int32)
    entered = np.zeros_like(field.is_gathered)
    if field.cells.size:
        kernels.march_panoramas(
            field.cells,
            np.ascontiguousarray(positions_m / size_m - field.first_index, np.float64),
            grid.tan_low,
            grid.tan_high,
            range_m / size_m,
            OPAQUE_BELOW,
            size_m / free_path_m,
            volume,
            voxels,
            surface,
            first_unseen,
            entered,
        )
    # The kernel measures in voxels.
    return Panoramas(
        unseen_volume_m3=volume * np.float32(size_m**3),
        unseen_voxels=voxels,
        new_surface_m2=surface * np.float32(size_m**2),
        first_unseen=first_unseen,
        entered=entered,
    )


def in_window(
    window: Float64[ndarray, "n_elevations n_azimuths"], yaw_indices: Int[ndarray, " n"]
) -> Float64[ndarray, "n n_elevations n_azimuths"]:
    """How much of each direction a camera sees that is turned to yaw `yaw_indices[i]`."""
    n_azimuths = window.shape[1]
    columns = (np.arange(n_azimuths)[None] - yaw_indices[:, None]) % n_azimuths
    return np.moveaxis(window[:, columns], 0, 1)


def by_yaw(
    panoramas: Float32[ndarray, "n n_elevations n_azimuths"],
    window: Float64[ndarray, "n_elevations n_azimuths"],
) -> Float64[ndarray, "n n_azimuths"]:
    """Slide a window over the panoramas: `sum_em window[e, m] panorama[e, k + m]` for yaw `k`."""
    sums = np.zeros((len(panoramas), window.shape[1]))
    kernels.slide_window(panoramas, window, sums)
    return sums
