"""The map's own idea of where its pictures are wrong, scored against where they are."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32
from numpy import ndarray

from hgs_core.evaluation.result import ErrorPrediction
from hgs_core.evaluation.uncertainty import prediction_score
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.information import quality_image
from hgs_core.gaussians.posterior_image import PRIOR_INFORMATION, PosteriorImages, train_information
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframes import halved_camera
from hgs_core.native import kernels


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorPredictors:
    """A finished map together with what its frames told of it."""

    gaussians: GaussianMap
    """The map, its `information` being that of all frames."""
    posterior: PosteriorImages

    @staticmethod
    def of(
        gaussians: GaussianMap, intrinsics: CameraIntrinsics, training_poses: SE3, *, range_m: float
    ) -> ErrorPredictors:
        """From the map and the poses (batched) of the frames that it was learnt from; changes neither.

        Frames count as the halved images that they are learnt from, as far as the sensor reaches.
        """
        information = train_information(
            gaussians, halved_camera(intrinsics), training_poses, far_m=range_m + kernels.BEHIND_M
        )
        rows = np.zeros_like(gaussians.information)
        rows[: gaussians.size] = information
        return ErrorPredictors(
            gaussians=replace(gaussians, information=rows),
            posterior=PosteriorImages(gaussians, information),
        )

    def score(
        self,
        error: Float32[ndarray, "height width"],
        depth_m: Float32[ndarray, "height width"],
        mask: Bool[ndarray, "height width"],
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
    ) -> ErrorPrediction:
        """How well each predictor ranks the `error` of a picture, `depth_m` being its rendered depth."""
        gain = quality_image(self.gaussians, intrinsics, T_world_camera, PRIOR_INFORMATION)
        return ErrorPrediction(
            quality=prediction_score(self.posterior.render(intrinsics, T_world_camera), error, mask),
            gain=prediction_score(gain, error, mask),
            depth=prediction_score(depth_m, error, mask),
            constant=prediction_score(np.ones_like(error), error, mask),
        )
