"""The views that a report shows: the map's picture beside the camera's, best, median and worst."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray

from hgs_core.evaluation.error_prediction import ErrorPredictors
from hgs_core.evaluation.images import psnr_db
from hgs_core.evaluation.report_parts import HeldOutImage
from hgs_core.evaluation.result import ErrorPrediction
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.keyframes import halved_camera
from hgs_core.scene.ray_caster import RayCaster

N_KEYFRAMES_TRIED: Final = 15
"""Keyframes, evenly spread over the mission, that the shown ones are chosen from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownView:
    """One view in pictures and figures."""

    rank: str
    """best, median or worst."""
    psnr_db: float
    quality_correlation: float | None
    depth_correlation: float | None
    observed: UInt8[ndarray, "h w 3"]
    rendered: Float32[ndarray, "h w 3"]
    """Clipped to 0..1."""
    depth_m: Float32[ndarray, "h w"]
    uncertainty: Float32[ndarray, "h w"]
    """Posterior variance of the map's colours."""

    @property
    def error(self) -> Float32[ndarray, "h w"]:
        """Absolute colour error, mean of the channels."""
        return np.abs(self.rendered - self.observed / np.float32(255.0)).mean(axis=2)


def held_out_views(
    images: tuple[HeldOutImage, ...],
    caster: RayCaster,
    gaussians: GaussianMap,
    predictors: ErrorPredictors,
    intrinsics: CameraIntrinsics,
) -> list[ShownView]:
    """The held-out views of best, median and worst PSNR, observed in the true scene; none where none has one.

    Pictures are whole; figures are those of `images`, over what some training frame saw.
    """
    measured = [image for image in images if image.psnr_db is not None]
    shown = []
    for rank, place in _best_median_worst([image.psnr_db or 0.0 for image in measured]):
        image = measured[place]
        pose = SE3.from_quaternion_wxyz(np.array(image.quaternion_wxyz), np.array(image.position_m))
        camera = halved_camera(intrinsics)
        view = render(gaussians, camera, pose)
        shown.append(
            ShownView(
                rank=rank,
                psnr_db=image.psnr_db or 0.0,
                quality_correlation=image.quality_correlation,
                depth_correlation=image.quality_correlation_depth_only,
                observed=caster.render(camera, pose)[0],
                rendered=np.clip(view.colour, 0.0, 1.0),
                depth_m=view.depth_m,
                uncertainty=predictors.posterior.render(camera, pose),
            )
        )
    return shown


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyframeViews:
    """Keyframes shown because nothing was held out, and how the tried ones scored."""

    shown: list[ShownView]
    scores: list[ErrorPrediction]


def keyframe_views(
    keyframes: KeyframeArchive, gaussians: GaussianMap, predictors: ErrorPredictors
) -> KeyframeViews:
    """Keyframes of best, median and worst PSNR among `N_KEYFRAMES_TRIED`, halved as they were learnt from.

    Figures are over pixels with a measured depth.
    """
    tried = np.unique(np.linspace(0, len(keyframes) - 1, N_KEYFRAMES_TRIED).round().astype(int))
    scores, qualities = [], []
    for index in tried.tolist():
        image = keyframes.load_halved(index)
        view = render(gaussians, image.intrinsics, image.T_world_camera)
        reference = image.rgb / np.float32(255.0)
        colour = np.clip(view.colour, 0.0, 1.0)
        error = np.abs(colour - reference).mean(axis=2)
        scores.append(
            predictors.score(error, view.depth_m, image.measured, image.intrinsics, image.T_world_camera)
        )
        qualities.append(psnr_db(colour, reference, image.measured))
    shown = []
    # A keyframe without any depth has no figures: it is not shown.
    finite = [k for k in range(len(tried)) if np.isfinite(qualities[k])]
    for rank, place in _best_median_worst([qualities[k] for k in finite]):
        k = finite[place]
        image = keyframes.load_halved(int(tried[k]))
        view = render(gaussians, image.intrinsics, image.T_world_camera)
        shown.append(
            ShownView(
                rank=rank,
                psnr_db=qualities[k],
                quality_correlation=scores[k].quality.correlation,
                depth_correlation=scores[k].depth.correlation,
                observed=image.rgb,
                rendered=np.clip(view.colour, 0.0, 1.0),
                depth_m=view.depth_m,
                uncertainty=predictors.posterior.render(image.intrinsics, image.T_world_camera),
            )
        )
    return KeyframeViews(shown=shown, scores=scores)


def _best_median_worst(qualities: list[float]) -> list[tuple[str, int]]:
    """Places of the best, median and worst quality; fewer where there are fewer than three."""
    order = np.argsort(qualities, kind="stable")[::-1].tolist()
    ranks = {len(order) // 2: "median", len(order) - 1: "worst", 0: "best"}
    return [(ranks[place], order[place]) for place in sorted(ranks) if 0 <= place < len(order)]
