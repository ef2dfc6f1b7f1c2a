"""Uncertainty of the voxels, and how much of it a view sees (NARUTO's goal search).

See `hgs_core.planning.baselines.naruto`. A voxel's uncertainty is 1 where it is missing, the mean of
its Gaussians' posterior variances where it is occupied (in shares of the prior's: `lambda / (H_train +
lambda)` of their colours, as in HGS-Planner Eq. 9), and 0 elsewhere.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float, Float64, Int
from numpy import ndarray

from hgs_core.gain.adaptive import at_best_yaws
from hgs_core.gain.by_voxel import colour_information, opaque_voxels, sums_by_voxel
from hgs_core.gain.panorama import PanoramaGrid
from hgs_core.gain.sight import SightLimits, Targets, seen_by_yaw
from hgs_core.gain.viewpoint import GainConfig, ViewGains
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState


def voxel_uncertainty(snapshot: MapSnapshot, prior_information: float) -> Float64[ndarray, "nx ny nz"]:
    """The uncertainty of each voxel, 0..1."""
    voxels, gaussians = snapshot.voxels, snapshot.gaussians
    posterior = prior_information / (colour_information(gaussians) + prior_information)
    sums, counts = sums_by_voxel(voxels, gaussians, posterior)
    uncertainty = np.where(voxels.states == VoxelState.OCCUPIED, sums / np.maximum(counts, 1), 0.0)
    uncertainty[voxels.missing()] = 1.0
    return uncertainty


class UncertaintyGain:
    """Scores viewpoints by the uncertainty of the drawn voxels that they see, in cubic metres.

    A view's gain is the sum of the uncertainties of the targets in it, times the volume that each stands
    for; that of a target is always the newest map's.
    """

    def __init__(self, config: GainConfig, camera: CameraIntrinsics) -> None:
        self.config = config
        self._grid = PanoramaGrid.for_camera(
            camera, n_azimuths=config.azimuth_bins, n_elevations=config.elevation_bins
        )
        self._targets: Int[ndarray, "n 3"] = np.zeros((0, 3), np.int64)
        """Global indices of voxels."""
        self._stands_for = 1.0
        self._reach_m = (0.0, 0.0)
        self._uncertainty = np.zeros((0, 0, 0))
        self._uncertainty_of: MapSnapshot | None = None

    def uncertainty(self, snapshot: MapSnapshot) -> Float64[ndarray, "nx ny nz"]:
        """See `voxel_uncertainty`; worked out once for each state of the maps."""
        if not snapshot.is_same(self._uncertainty_of):
            self._uncertainty = voxel_uncertainty(snapshot, self.config.prior_information)
            self._uncertainty_of = snapshot
        return self._uncertainty

    def aim_at(
        self,
        voxels: VoxelMap,
        index: Int[ndarray, "n 3"],
        *,
        stands_for: float,
        reach_m: tuple[float, float],
    ) -> None:
        """From now on score by these voxels (array indices), each standing for so many, from the least to
        the greatest horizontal distance `reach_m`."""
        self._targets = index + voxels.origin_index
        self._stands_for = stands_for
        self._reach_m = reach_m

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: Float[ndarray, "n 3"],
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        """See `GainEvaluator`: the gain is that of coverage [m^3]; nothing is left to quality."""
        voxels = snapshot.voxels
        uncertainty = self.uncertainty(snapshot)
        index = self._targets - voxels.origin_index
        inside = np.all((index >= 0) & (index < voxels.states.shape), axis=1)
        volume_m3 = self._stands_for * voxels.config.size_m**3
        targets = Targets(
            points_m=voxels.centres_m(index[inside]),
            weights=uncertainty[tuple(index[inside].T)] * volume_m3,
        )
        near_m, far_m = self._reach_m
        limits = SightLimits(near_m=near_m, far_m=far_m, level=True)
        gains = seen_by_yaw(self._grid, targets, voxels, opaque_voxels(voxels), positions_m, limits)
        total = gains / self.config.coverage_scale_m3
        return at_best_yaws(self._grid.yaws_rad, gains, np.zeros_like(gains), total)

    def state(self) -> dict[str, Any]:
        return {
            "targets": self._targets.copy(),
            "stands_for": self._stands_for,
            "reach_m": list(self._reach_m),
        }

    def restore(self, state: dict[str, Any]) -> None:
        near_m, far_m = state["reach_m"]
        self._targets = np.array(state["targets"])
        self._stands_for = float(state["stands_for"])
        self._reach_m = (float(near_m), float(far_m))
