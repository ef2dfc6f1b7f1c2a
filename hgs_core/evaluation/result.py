"""Everything that is measured against ground truth after a mission."""

from __future__ import annotations

from dataclasses import dataclass

from hgs_core.evaluation.compatibility import CompatibilityMetrics
from hgs_core.evaluation.surface import SurfaceMetrics
from hgs_core.evaluation.uncertainty import PredictionScore
from hgs_core.geometry.se3 import SE3


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorPrediction:
    """How well the map tells where one of its pictures is wrong, beside predictors that it must beat."""

    quality: PredictionScore
    """By the posterior variance of the map's colours (`PosteriorImages`)."""
    gain: PredictionScore
    """By Eq. 9's gain of each pixel (`quality_image`)."""
    depth: PredictionScore
    """By the rendered depth alone: the farther, the worse."""
    constant: PredictionScore
    """By one number for all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewResult:
    """One held-out view under its mask; NaN where the mask holds too little."""

    T_world_camera: SE3
    observed_share: float
    psnr_db: float
    ssim: float
    prediction: ErrorPrediction


@dataclass(frozen=True, kw_only=True)
class ImageMetrics:
    """Held-out views, map against truth; means over views, NaN where nothing can be measured.

    Masked figures use pixels whose true surface point some training frame saw.
    """

    n_views: int
    psnr_db: float
    ssim: float
    depth_l1_cm: float
    median_depth_error_cm: float
    """Over the masked pixels of all views together."""
    psnr_db_unmasked: float
    ssim_unmasked: float
    observed_mask_share: float
    """Masked pixels / all pixels, over all views."""
    views: tuple[ViewResult, ...] = ()


@dataclass(frozen=True, kw_only=True)
class EvaluationResult:
    """One map against its scene."""

    surface: SurfaceMetrics
    """From all Gaussian centres."""
    surface_opaque: SurfaceMetrics
    """From the centres of Gaussians of opacity 0.5 or more."""
    surface_mesh: SurfaceMetrics | None = None
    """From the vertices of the fused mesh, where there is one."""
    naruto: CompatibilityMetrics
    """What NARUTO's evaluator would print of all Gaussian centres."""
    activegamer: CompatibilityMetrics
    """What ActiveGAMER's evaluator would print of them."""
    observable_fraction: float
    """Share of the true surface that any reachable camera pose can see."""
    n_reachable: int
    """Grid positions that the robot can reach from its start."""
    images: ImageMetrics
    wall_s: float
    """Wall seconds that the evaluation took."""
