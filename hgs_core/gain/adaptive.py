"""The adaptive total of coverage and quality, and the best yaws (HGS-Planner Eq. 10, Algorithm 1)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import PlanningError
from hgs_core.gain.viewpoint import CoverageMeasure, GainConfig, ViewGains


def adaptive_gains(
    config: GainConfig,
    yaws_rad: Float[ndarray, " n_yaws"],
    coverage: Float[ndarray, "n n_yaws"],
    quality: Float[ndarray, "n n_yaws"],
    *,
    observed_share: float,
) -> ViewGains:
    """`G = C / coverage_scale + lambda_o Q / quality_scale` at every yaw, and the yaw where it is largest.

    Eq. 10 adds the gains as they are; here each is first divided by its scale, so that volume and area can
    be added. `lambda_o` is the observed share of the local region, or 1 when not adaptive. A gain that is
    switched off is 0. Raises `PlanningError` for a share outside 0..1.
    """
    if not 0.0 <= observed_share <= 1.0:
        raise PlanningError(f"the observed share must lie in 0..1, got {observed_share}")
    coverage = coverage if config.use_coverage else np.zeros_like(coverage)
    quality = quality if config.use_quality else np.zeros_like(quality)
    weight = observed_share if config.adaptive else 1.0
    by_surface = config.coverage_measure is CoverageMeasure.SURFACE
    scale = config.coverage_scale_m2 if by_surface else config.coverage_scale_m3
    total = coverage / scale + weight * quality / config.quality_scale_m2
    return at_best_yaws(yaws_rad, coverage, quality, total)


def at_best_yaws(
    yaws_rad: Float[ndarray, " n_yaws"],
    coverage: Float[ndarray, "n n_yaws"],
    quality: Float[ndarray, "n n_yaws"],
    total: Float[ndarray, "n n_yaws"],
) -> ViewGains:
    """Gains around the circle, with those at the yaw where the total is largest (of equal ones the first)."""
    best = np.argmax(total, axis=1)
    rows = np.arange(len(total))
    return ViewGains(
        yaws_rad=yaws_rad,
        coverage_by_yaw=coverage,
        quality_by_yaw=quality,
        total_by_yaw=total,
        coverage=coverage[rows, best],
        quality=quality[rows, best],
        total=total[rows, best],
        best_yaw_rad=yaws_rad[best],
    )
