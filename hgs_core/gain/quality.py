"""Quality gain: how much a view would add to what is known of the Gaussians (HGS-Planner Eq. 5-9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.gain.panorama import PanoramaGrid, by_yaw
from hgs_core.gaussians.gaussian_map import N_PARAMETERS
from hgs_core.gaussians.information import parameter_priors
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap

SIDEWAYS_POWER, OTHER_POWER = 5, 4
"""How the score of a direction grows towards the sides of an image, as powers of 1 / cos(angle off the axis).
Three are for the pixels that it has there. The rest is the flat image's: off its axis a Gaussian that moves
moves farther in it, most of all sideways."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RaySample:
    """The directions of a panorama that are scored exactly, and how a camera sees them."""

    grid: PanoramaGrid
    sideways: Float64[ndarray, "n_elevations n_azimuths"]
    """Window over the scores by sideways motion."""
    other: Float64[ndarray, "n_elevations n_azimuths"]
    """Window over those by all else."""

    @staticmethod
    def for_camera(camera: CameraIntrinsics, *, n_azimuths: int, n_elevations: int) -> RaySample:
        grid = PanoramaGrid.for_camera(camera, n_azimuths=n_azimuths, n_elevations=n_elevations)
        return RaySample(grid=grid, sideways=grid.window(SIDEWAYS_POWER), other=grid.window(OTHER_POWER))


class FisherField:
    """A map's Gaussians, sorted chunk by chunk where they are asked for, so that rays find what they meet.

    The score of a view, `sum_ik H_cand,ik / (H_train,ik + prior_k)` (the trace form), is a sum over its
    pixels. A sample of the panorama's rays is scored exactly, each as the middle column of a level camera of
    full resolution that looks along it: nothing is lost to a coarse image, hidden Gaussians count where they
    show, and a surface seen from one side so far counts as it looks from another.
    """

    def __init__(
        self,
        voxels: VoxelMap,
        camera: CameraIntrinsics,
        *,
        prior_information: float,
        saturation_m: float,
        range_m: float,
    ) -> None:
        shape = np.array(voxels.states.shape, dtype=np.int64)
        self._focal_px = float(np.sqrt(camera.fx * camera.fy))
        self._kernel = kernels.FisherField(
            shape,
            voxels.origin_index * voxels.config.size_m,
            voxels.config.size_m,
            parameter_priors(prior_information),
            camera.low_pass_px2 / self._focal_px**2,
            saturation_m,
            range_m,
            [
                max(camera.cx, camera.width - camera.cx) / camera.fx,
                max(camera.cy, camera.height - camera.cy) / camera.fy,
            ],
        )
        self._is_gathered = np.zeros(-(-shape[:2] // kernels.GAIN_CHUNK), dtype=bool)

    def forget(self) -> None:
        """The map has changed."""
        self._kernel.clear()
        self._is_gathered[:] = False

    def gather(self, snapshot: MapSnapshot, chunks: Bool[ndarray, "n_chunks_x n_chunks_y"]) -> None:
        """Sort the Gaussians of those of the chunks that are not gathered yet."""
        wanted = chunks & ~self._is_gathered
        gaussians = snapshot.gaussians
        if wanted.any():
            rows = slice(gaussians.size)
            self._kernel.gather(
                gaussians.parameters[rows], gaussians.normals[rows], gaussians.block_bounds, wanted
            )
            self._is_gathered[wanted] = True

    def score_by_yaw(
        self, sample: RaySample, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"]
    ) -> Float64[ndarray, "n n_yaws"]:
        """Eq. 9's gain of the camera at each yaw. Everything in reach must have been gathered."""
        grid = sample.grid
        scores = self.scores(sample, snapshot, positions_m)
        row_step = (grid.tan_high - grid.tan_low) / grid.n_elevations
        pixels_of_ray = self._focal_px**2 * grid.azimuth_step_rad * row_step  # on the camera's axis
        sideways, other = (np.ascontiguousarray(scores[..., part]) for part in range(2))
        by_yaws: Float64[ndarray, "n n_yaws"] = pixels_of_ray * (
            by_yaw(sideways, sample.sideways) + by_yaw(other, sample.other)
        )
        return by_yaws

    def scores(
        self, sample: RaySample, snapshot: MapSnapshot, positions_m: Float[ndarray, "n 3"]
    ) -> Float32[ndarray, "n n_elevations n_azimuths 2"]:
        """The score of each ray as the middle column of a camera that looks along it: by sideways motion, and
        by all else. Everything in reach must have been gathered."""
        grid, gaussians = sample.grid, snapshot.gaussians
        scores = np.zeros((len(positions_m), grid.n_elevations, grid.n_azimuths, 2), np.float32)
        self._kernel.score(
            gaussians.parameters[: gaussians.size],
            gaussians.normals[: gaussians.size],
            gaussians.information[: gaussians.size],
            np.ascontiguousarray(positions_m, np.float64),
            grid.tan_low,
            grid.tan_high,
            scores,
        )
        return scores


def as_area(scores: Float64[ndarray, "n n_yaws"], *, gaussians_per_m2: float) -> Float64[ndarray, "n n_yaws"]:
    """Scores as m^2 of surface seen once more as well as before.

    A Gaussian that is seen once more as well as in all frames together scores its number of parameters, so a
    square metre that holds `gaussians_per_m2` scores `8 gaussians_per_m2`: areas can be compared between maps
    of any density.
    """
    if gaussians_per_m2 == 0:
        return np.zeros_like(scores)
    areas: Float64[ndarray, "n n_yaws"] = scores / (N_PARAMETERS * gaussians_per_m2)
    return areas
