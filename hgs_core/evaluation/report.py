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
from hgs_core.evaluation.report_parts import (
    Figure,
    HeldOutImage,
    PlanningCycle,
    PlanningSeconds,
    RefinementEntry,
    ReportPart,
    UnseenEntry,
)
from hgs_core.evaluation.result import EvaluationResult
from hgs_core.evaluation.surface import THRESHOLDS_CM, SurfaceMetrics

SCHEMA_VERSION: Final = 1


_OF_THE_MAP: Final = (
    *("accuracy_", "completion_", "precision_", "recall_", "f1_", "n_gaussians_opaque"),
    *("psnr_", "ssim", "depth_l1_", "median_depth_", "quality_correlation", "sparsification_"),
)
"""How the names of the figures begin that hold for one map alone."""


class MissionReport(ReportPart):
    """What one mission did and how good its map is."""

    schema_version: int = SCHEMA_VERSION
    """Version of this layout."""

    scene: str
    """Name or file of the scene."""
    seed: int
    clock: str = "lockstep"
    """lockstep or real."""
    planner: str
    """The planner's name: the mission's preset unless a planner was named."""
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

    @classmethod
    def compose(
        cls,
        *,
        scene: str,
        seed: int,
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
            planner=planner,
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
        )
        return report if evaluation is None else report.with_evaluation(evaluation)

    def with_evaluation(self, evaluation: EvaluationResult) -> MissionReport:
        """This report with every quality figure replaced by those of `evaluation`."""
        every, opaque, images = evaluation.surface, evaluation.surface_opaque, evaluation.images
        at_5cm = THRESHOLDS_CM.index(5)
        figures: dict[str, float | int | None] = {
            "accuracy_cm": every.accuracy_cm,
            "completion_cm": every.completion_cm,
            "completion_ratio": every.completion_ratio,
            "completion_cm_observable": every.completion_cm_observable,
            "completion_ratio_observable": every.completion_ratio_observable,
            "observable_fraction": evaluation.observable_fraction,
            "accuracy_cm_to_samples": every.accuracy_cm_to_samples,
            "n_gaussians_opaque": opaque.n_points,
            "accuracy_cm_opaque": opaque.accuracy_cm,
            "completion_cm_opaque": opaque.completion_cm,
            "completion_ratio_opaque": opaque.completion_ratio,
            "completion_ratio_observable_opaque": opaque.completion_ratio_observable,
            "precision_5cm_opaque": opaque.precision[at_5cm],
            "f1_5cm_opaque": opaque.f1[at_5cm],
            "psnr_db": images.psnr_db,
            "ssim": images.ssim,
            "depth_l1_cm": images.depth_l1_cm,
            "psnr_db_unmasked": images.psnr_db_unmasked,
            "ssim_unmasked": images.ssim_unmasked,
            "observed_mask_share": images.observed_mask_share,
            "median_depth_error_cm": images.median_depth_error_cm,
            "held_out_views": images.n_views,
            "evaluation_s": evaluation.wall_s,
        }
        figures.update(_mesh_figures(evaluation.surface_mesh))
        held_out = [HeldOutImage.of(view) for view in images.views]
        figures.update({key: _mean([getattr(image, key) for image in held_out]) for key in _PREDICTION_KEYS})
        for index, cm in enumerate(THRESHOLDS_CM):
            figures[f"precision_{cm}cm"] = every.precision[index]
            figures[f"recall_{cm}cm"] = every.recall[index]
            figures[f"f1_{cm}cm"] = every.f1[index]
        return type(self).model_validate(
            {**self.model_dump(by_alias=True), **figures, "held_out_images": held_out}
        )

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
            if name.startswith(_OF_THE_MAP) and not name.endswith("_mesh")
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


_PREDICTION_KEYS: Final = tuple(
    key
    for key in HeldOutImage.model_fields
    if key.startswith(("quality_correlation", "sparsification_error"))
)


def _mesh_figures(mesh: SurfaceMetrics | None) -> dict[str, float | int | None]:
    if mesh is None:
        mesh_keys = [key for key in MissionReport.model_fields if key.endswith("_mesh")]
        return dict.fromkeys(mesh_keys)
    at_5cm = THRESHOLDS_CM.index(5)
    return {
        "n_vertices_mesh": mesh.n_points,
        "accuracy_cm_mesh": mesh.accuracy_cm,
        "completion_cm_mesh": mesh.completion_cm,
        "completion_ratio_mesh": mesh.completion_ratio,
        "completion_cm_observable_mesh": mesh.completion_cm_observable,
        "completion_ratio_observable_mesh": mesh.completion_ratio_observable,
        "precision_5cm_mesh": mesh.precision[at_5cm],
        "f1_5cm_mesh": mesh.f1[at_5cm],
    }


def _mean(values: Sequence[float | None]) -> float | None:
    measured = [value for value in values if value is not None]
    return float(np.mean(measured)) if measured else None


def _quantile(values: Sequence[float], share: float) -> float | None:
    return float(np.quantile(values, share)) if len(values) else None
