"""Everything that is measured against ground truth after a mission."""

from __future__ import annotations

from dataclasses import dataclass

from hgs_core.evaluation.surface import SurfaceMetrics


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


@dataclass(frozen=True, kw_only=True)
class EvaluationResult:
    """One map against its scene."""

    surface: SurfaceMetrics
    """From all Gaussian centres."""
    surface_opaque: SurfaceMetrics
    """From the centres of Gaussians of opacity 0.5 or more."""
    observable_fraction: float
    """Share of the true surface that any reachable camera pose can see."""
    n_reachable: int
    """Grid positions that the robot can reach from its start."""
    images: ImageMetrics
    wall_s: float
    """Wall seconds that the evaluation took."""
