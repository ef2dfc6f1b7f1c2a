"""The parts that a mission's report is made of: nested values of `report.json`."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from hgs_core.evaluation.result import ViewResult


def _finite_or_none(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Figure = Annotated[float | None, BeforeValidator(_finite_or_none)]
"""A measured number; None = not measured."""


class ReportPart(BaseModel):
    """Frozen; unknown keys are an error."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", use_attribute_docstrings=True, populate_by_name=True
    )


class PlanningSeconds(ReportPart):
    """Wall seconds of a planning cycle: T_P = T_VE + T_LP + T_GP (HGS-Planner section IV-B)."""

    median: Figure = None
    """Median of T_P over the mission's cycles."""
    p95: Figure = None
    """95th percentile of T_P."""
    viewpoint_evaluation: Figure = None
    """Median of T_VE: viewpoint sampling and evaluation."""
    local: Figure = None
    """Median of T_LP: the local tour and path."""
    global_: Figure = Field(default=None, alias="global")
    """Median of T_GP: the global tour."""


class Region(ReportPart):
    """An axis-aligned box in the world [m]."""

    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]


class UnseenEntry(ReportPart):
    """One region that the mission left unseen."""

    region: Region
    volume_m3: float
    """Missing volume in it [m^3]."""
    reason: str
    """unreachable, below_threshold, occluded, out_of_bounds, time_limit or interrupted."""


class CurvePoint(ReportPart):
    """How complete the map was at one moment of the mission."""

    path_m: float
    """How far the robot had driven."""
    time_s: float
    """Mission time."""
    ratio: float
    """Observable completion ratio: share of what any reachable camera pose can see with a Gaussian's centre
    within 5 cm."""


class HeldOutImage(ReportPart):
    """One held-out view, over surface that some training frame saw."""

    position_m: tuple[float, float, float]
    quaternion_wxyz: tuple[float, float, float, float]
    """`T_world_camera`."""
    observed_share: float
    """Share of its pixels that the figures use."""
    psnr_db: Figure = None
    ssim: Figure = None
    quality_correlation: Figure = None
    """As the report's own keys of these names, for this view."""
    quality_correlation_gain: Figure = None
    quality_correlation_depth_only: Figure = None
    sparsification_error: Figure = None
    sparsification_error_gain: Figure = None
    sparsification_error_depth_only: Figure = None
    sparsification_error_constant: Figure = None

    @staticmethod
    def of(view: ViewResult) -> HeldOutImage:
        pose, prediction = view.T_world_camera, view.prediction
        return HeldOutImage(
            position_m=tuple(pose.translation.tolist()),
            quaternion_wxyz=tuple(pose.as_quaternion_wxyz().tolist()),
            observed_share=view.observed_share,
            psnr_db=view.psnr_db,
            ssim=view.ssim,
            quality_correlation=prediction.quality.correlation,
            quality_correlation_gain=prediction.gain.correlation,
            quality_correlation_depth_only=prediction.depth.correlation,
            sparsification_error=prediction.quality.sparsification_error,
            sparsification_error_gain=prediction.gain.sparsification_error,
            sparsification_error_depth_only=prediction.depth.sparsification_error,
            sparsification_error_constant=prediction.constant.sparsification_error,
        )


class PlanningCycle(ReportPart):
    """Wall seconds of the three parts of one planning cycle."""

    viewpoint_evaluation_s: float
    local_s: float
    global_s: float


class RefinementEntry(ReportPart):
    """What `hgs refine` did to the map since its mission, and how good the mission had left it."""

    seconds: float
    """Wall seconds of all refinements so far."""
    steps: int
    psnr_db_before: Figure = None
    """Of the map that the mission left, likewise below; null where it was not evaluated."""
    ssim_before: Figure = None
    median_depth_error_cm_before: Figure = None
    accuracy_cm_before: Figure = None
    completion_cm_observable_before: Figure = None
    completion_ratio_observable_before: Figure = None
