"""`report.json`: every figure of one mission. Keys are never renamed; later versions add keys.

Values that were not measured, or are not finite, are null.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import ValidationError

from hgs_core.errors import ConfigError
from hgs_core.evaluation.completion_curve import path_m_at, time_s_at
from hgs_core.evaluation.quality_figures import quality_figures
from hgs_core.evaluation.report_parts import (
    CurvePoint,
    Figure,
    HeldOutImage,
    PlanningCycle,
    PlanningSeconds,
    RefinementEntry,
    ReportPart,
    UnseenEntry,
)
from hgs_core.evaluation.result import EvaluationResult

SCHEMA_VERSION: Final = 1


_OF_THE_MAP: Final = (
    *("accuracy_", "completion_", "precision_", "recall_", "f1_", "n_gaussians_opaque"),
    *("psnr_", "ssim", "depth_l1_", "median_depth_", "quality_correlation", "sparsification_", "compat_"),
)
"""How the names of the figures begin that hold for one map alone."""
_OF_THE_MISSION: Final = ("completion_curve",)
"""What begins likewise and does not."""


class MissionReport(ReportPart):
    """What one mission did and how good its map is."""

    schema_version: int = SCHEMA_VERSION
    """Version of this layout."""

    scene: str
    """Name or file of the scene."""
    seed: int
    clock: str = "lockstep"
    """lockstep or real."""
    preset: str | None = None
    """The mission preset's name; null in reports of earlier versions."""
    planner: str
    """The planner's name: the mission's preset unless a planner was named."""
    extends: str | None = None
    """Folder of the run whose maps the mission began with; path and time are of this mission alone."""
    stop_reason: str
    """complete, interrupted, time_limit, stuck or failed."""
    stop_message: str = ""
    """One sentence on why the mission ended."""
    wall_s: Figure = None
    """Wall seconds of the whole mission, evaluation excluded."""
    sim_time_s: Figure = None
    """Mission time: what the robot lived through; counted under the lockstep clock, measured under the real
    one."""
    path_length_m: Figure = None
    frames: int
    """Frames taken."""
    frames_dropped: int = 0
    """Frames that fell due while mapper and planner were busy, and were never taken."""
    frames_thinned: int = 0
    """Frames taken that showed nothing new and went into the voxels alone."""
    keyframes: int
    n_gaussians: int
    """Gaussians in the final map."""
    peak_rss_mib: Figure = None
    """Largest resident memory of the mission's process [MiB], evaluation excluded."""

    accuracy_cm: Figure = None
    """Mean distance of all Gaussian centres to the true surface."""
    completion_cm: Figure = None
    """Mean distance of the true surface's samples to the nearest Gaussian centre."""
    completion_ratio: Figure = None
    """Share of the samples closer than 5 cm to a centre."""
    completion_cm_observable: Figure = None
    """Completion over what any reachable camera pose can see."""
    completion_ratio_observable: Figure = None
    """Completion ratio over what any reachable camera pose can see."""
    observable_fraction: Figure = None
    """Share of the true surface that any reachable camera pose can see."""
    precision_1cm: Figure = None
    """Share of Gaussian centres closer than 1 cm to the true surface; likewise below."""
    precision_2cm: Figure = None
    precision_5cm: Figure = None
    precision_10cm: Figure = None
    recall_1cm: Figure = None
    """Share of the true surface's samples closer than 1 cm to a centre; likewise below."""
    recall_2cm: Figure = None
    recall_5cm: Figure = None
    recall_10cm: Figure = None
    f1_1cm: Figure = None
    """Harmonic mean of precision and recall at 1 cm; likewise below."""
    f1_2cm: Figure = None
    f1_5cm: Figure = None
    f1_10cm: Figure = None
    accuracy_cm_to_samples: Figure = None
    """Accuracy measured to the 300 000 samples instead of the surface, as public evaluators do."""
    n_gaussians_opaque: int | None = None
    """Gaussians of opacity 0.5 or more; the columns `*_opaque` use these alone."""
    accuracy_cm_opaque: Figure = None
    completion_cm_opaque: Figure = None
    completion_ratio_opaque: Figure = None
    completion_ratio_observable_opaque: Figure = None
    precision_5cm_opaque: Figure = None
    f1_5cm_opaque: Figure = None
    n_vertices_mesh: int | None = None
    """Vertices of the fused mesh; the columns `*_mesh` use these alone."""
    accuracy_cm_mesh: Figure = None
    completion_cm_mesh: Figure = None
    completion_ratio_mesh: Figure = None
    completion_cm_observable_mesh: Figure = None
    completion_ratio_observable_mesh: Figure = None
    precision_5cm_mesh: Figure = None
    f1_5cm_mesh: Figure = None

    psnr_db: Figure = None
    """PSNR on held-out views, over surface that some training frame saw; mean over views."""
    ssim: Figure = None
    """SSIM likewise."""
    depth_l1_cm: Figure = None
    """Mean absolute depth error likewise."""
    psnr_db_unmasked: Figure = None
    """PSNR over whole held-out views."""
    ssim_unmasked: Figure = None
    observed_mask_share: Figure = None
    """Share of held-out pixels that the masked figures use."""
    median_depth_error_cm: Figure = None
    """Median absolute depth error over the mask of all views."""
    held_out_views: int | None = None
    quality_correlation: Figure = None
    """Rank correlation of the posterior variance of the map's colours with the error, mean over views."""
    quality_correlation_gain: Figure = None
    """The same by Eq. 9's gain of each pixel."""
    quality_correlation_depth_only: Figure = None
    """The same by rendered depth alone."""
    sparsification_error: Figure = None
    """Area between the sparsification curves by posterior variance and by the error, mean over views."""
    sparsification_error_gain: Figure = None
    sparsification_error_depth_only: Figure = None
    sparsification_error_constant: Figure = None
    """The same by one number for all."""
    held_out_images: tuple[HeldOutImage, ...] = ()
    """Each held-out view."""

    refinement: RefinementEntry | None = None
    """What was done to the map after the mission; null if nothing."""

    planning_s: PlanningSeconds = PlanningSeconds()
    planning_cycles: int = 0
    mapping_s_per_frame: Figure = None
    """Mean wall seconds of mapping for a frame."""
    iterations: int | None = None
    """Optimisation steps of the whole mission."""
    real_time_factor: Figure = None
    """Mission time / wall time busy with mapping and planning (simulator and browser excluded)."""
    simulation_wall_s: Figure = None
    """Wall seconds spent in the simulator, for comparison."""
    collisions: int = 0
    """Contacts with the true mesh."""
    unseen: tuple[UnseenEntry, ...] = ()
    """What was left unseen, and why."""

    versions: dict[str, str]
    """Versions of this software and of what it computes with."""
    kernel_variant: str
    """Which native kernels ran: figures repeat exactly only on the same variant and thread count."""
    threads: int
    evaluation_s: Figure = None
    """Wall seconds of the evaluation."""

    completion_curve: tuple[CurvePoint, ...] = ()
    """Observable completion ratio over path and time; a sample once complete stays so until the last point,
    which is the evaluation's. Empty where it was not recorded."""
    path_m_at_90: Figure = None
    """Path length at which the curve first reaches 0.90; null if it never does."""
    path_m_at_95: Figure = None
    time_s_at_90: Figure = None
    """Mission time likewise."""
    curve_wall_s: Figure = None
    """Wall seconds of the curve's readings, which are part of `wall_s`."""
    compat_naruto_accuracy_cm: Figure = None
    """What NARUTO's evaluator calls so: completion, since it swaps its meshes; likewise below."""
    compat_naruto_completion_cm: Figure = None
    compat_naruto_completion_ratio: Figure = None
    compat_activegamer_accuracy_cm: Figure = None
    """What ActiveGAMER's evaluator calls so: of Gaussians nearest to true points alone; likewise below."""
    compat_activegamer_completion_cm: Figure = None
    compat_activegamer_completion_ratio: Figure = None

    @classmethod
    def compose(
        cls,
        *,
        scene: str,
        seed: int,
        preset: str,
        planner: str,
        stop_reason: str,
        stop_message: str,
        wall_s: float,
        sim_time_s: float,
        path_length_m: float,
        frames: int,
        keyframes: int,
        n_gaussians: int,
        peak_rss_mib: float,
        planning_cycles: Sequence[PlanningCycle],
        mapping_s: Sequence[float],
        clock: str,
        iterations: int,
        frames_dropped: int,
        frames_thinned: int,
        simulation_wall_s: float,
        collisions: int,
        unseen: Sequence[UnseenEntry],
        versions: Mapping[str, str],
        kernel_variant: str,
        threads: int,
        completion_curve: Sequence[CurvePoint] = (),
        curve_wall_s: float | None = None,
        extends: str | None = None,
        evaluation: EvaluationResult | None,
    ) -> MissionReport:
        """Put a mission's facts and its evaluation together.

        `mapping_s` holds wall seconds for each frame taken. Without `evaluation` (a mission that failed,
        or was interrupted before one) every quality figure is null.
        """
        totals = [cycle.viewpoint_evaluation_s + cycle.local_s + cycle.global_s for cycle in planning_cycles]
        busy_s = float(sum(mapping_s) + sum(totals))
        report = cls(
            scene=scene,
            seed=seed,
            preset=preset,
            planner=planner,
            extends=extends,
            stop_reason=stop_reason,
            stop_message=stop_message,
            wall_s=wall_s,
            sim_time_s=sim_time_s,
            path_length_m=path_length_m,
            clock=clock,
            frames=frames,
            frames_dropped=frames_dropped,
            frames_thinned=frames_thinned,
            iterations=iterations,
            keyframes=keyframes,
            n_gaussians=n_gaussians,
            peak_rss_mib=peak_rss_mib,
            planning_s=PlanningSeconds(
                median=_quantile(totals, 0.5),
                p95=_quantile(totals, 0.95),
                viewpoint_evaluation=_quantile([c.viewpoint_evaluation_s for c in planning_cycles], 0.5),
                local=_quantile([c.local_s for c in planning_cycles], 0.5),
                global_=_quantile([c.global_s for c in planning_cycles], 0.5),
            ),
            planning_cycles=len(planning_cycles),
            mapping_s_per_frame=float(np.mean(mapping_s)) if len(mapping_s) else None,
            real_time_factor=sim_time_s / busy_s if busy_s > 0 else None,
            simulation_wall_s=simulation_wall_s,
            collisions=collisions,
            unseen=tuple(unseen),
            versions=dict(versions),
            kernel_variant=kernel_variant,
            threads=threads,
            curve_wall_s=curve_wall_s,
            **_curve_figures(completion_curve),
        )
        return report if evaluation is None else report.with_evaluation(evaluation)

    def with_evaluation(self, evaluation: EvaluationResult) -> MissionReport:
        """This report with every quality figure replaced by those of `evaluation`.

        The completion curve ends with it, too, unless the map was optimised further since the mission.
        """
        figures = quality_figures(evaluation)
        curve = self.completion_curve
        if curve and self.refinement is None:
            last = curve[-1].model_copy(update={"ratio": evaluation.surface.completion_ratio_observable})
            figures.update(_curve_figures((*curve[:-1], last)))
        return type(self).model_validate({**self.model_dump(by_alias=True), **figures})

    def refined(self, *, seconds: float, steps: int) -> MissionReport:
        """This report after the map was optimised further, its quality figures unknown until evaluated.

        Those of the mission's own map are kept under `refinement`. Figures of the mesh stay: it is made from
        keyframes.
        """
        entry = self.refinement or RefinementEntry(
            seconds=0.0,
            steps=0,
            psnr_db_before=self.psnr_db,
            ssim_before=self.ssim,
            median_depth_error_cm_before=self.median_depth_error_cm,
            accuracy_cm_before=self.accuracy_cm,
            completion_cm_observable_before=self.completion_cm_observable,
            completion_ratio_observable_before=self.completion_ratio_observable,
        )
        entry = entry.model_copy(update={"seconds": entry.seconds + seconds, "steps": entry.steps + steps})
        unknown = {
            name: None
            for name in type(self).model_fields
            if name.startswith(_OF_THE_MAP) and name not in _OF_THE_MISSION and not name.endswith("_mesh")
        }
        return self.model_copy(update={**unknown, "held_out_images": (), "refinement": entry})

    def write(self, path: Path) -> None:
        """Write `path` whole or not at all (temporary file beside it, then rename)."""
        content = json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, allow_nan=False)
        partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
        partial.write_text(content + "\n", encoding="utf-8")
        partial.replace(path)

    @classmethod
    def read(cls, path: Path) -> MissionReport:
        """Raises `ConfigError` for a file that is missing, damaged, or written by a later version."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ConfigError(f"cannot read {path}: {error.strerror}") from error
        except ValueError as error:
            raise ConfigError(f"{path} is not JSON: {error}") from error
        version = content.get("schema_version") if isinstance(content, dict) else None
        if not isinstance(version, int) or not 1 <= version <= SCHEMA_VERSION:
            raise ConfigError(
                f"{path} has schema_version {version!r}; this version reads 1..{SCHEMA_VERSION}"
            )
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise ConfigError(f"{path} is not a mission report: {error}") from error


def _curve_figures(curve: Sequence[CurvePoint]) -> dict[str, object]:
    return {
        "completion_curve": tuple(curve),
        "path_m_at_90": path_m_at(curve, 0.90),
        "path_m_at_95": path_m_at(curve, 0.95),
        "time_s_at_90": time_s_at(curve, 0.90),
    }


def _quantile(values: Sequence[float], share: float) -> float | None:
    return float(np.quantile(values, share)) if len(values) else None
