"""An evaluation's figures under the keys of `report.json`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from hgs_core.evaluation.report_parts import HeldOutImage
from hgs_core.evaluation.result import EvaluationResult
from hgs_core.evaluation.surface import THRESHOLDS_CM, SurfaceMetrics

_PREDICTION_KEYS: Final = tuple(
    key
    for key in HeldOutImage.model_fields
    if key.startswith(("quality_correlation", "sparsification_error"))
)
_MESH_KEYS: Final = (
    *("n_vertices_mesh", "accuracy_cm_mesh", "completion_cm_mesh", "completion_ratio_mesh"),
    *("completion_cm_observable_mesh", "completion_ratio_observable_mesh"),
    *("precision_5cm_mesh", "f1_5cm_mesh"),
)


def quality_figures(evaluation: EvaluationResult) -> dict[str, object]:
    """Every key whose value an evaluation decides alone."""
    every, opaque, images = evaluation.surface, evaluation.surface_opaque, evaluation.images
    at_5cm = THRESHOLDS_CM.index(5)
    held_out = tuple(HeldOutImage.of(view) for view in images.views)
    figures: dict[str, object] = {
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
        "held_out_images": held_out,
        "evaluation_s": evaluation.wall_s,
    }
    figures.update(_mesh_figures(evaluation.surface_mesh))
    figures.update({key: _mean([getattr(image, key) for image in held_out]) for key in _PREDICTION_KEYS})
    for name, mode in (("naruto", evaluation.naruto), ("activegamer", evaluation.activegamer)):
        figures[f"compat_{name}_accuracy_cm"] = mode.accuracy_cm
        figures[f"compat_{name}_completion_cm"] = mode.completion_cm
        figures[f"compat_{name}_completion_ratio"] = mode.completion_ratio
    for index, cm in enumerate(THRESHOLDS_CM):
        figures[f"precision_{cm}cm"] = every.precision[index]
        figures[f"recall_{cm}cm"] = every.recall[index]
        figures[f"f1_{cm}cm"] = every.f1[index]
    return figures


def _mesh_figures(mesh: SurfaceMetrics | None) -> dict[str, float | None]:
    if mesh is None:
        return dict.fromkeys(_MESH_KEYS)
    at_5cm = THRESHOLDS_CM.index(5)
    values = (
        *(mesh.n_points, mesh.accuracy_cm, mesh.completion_cm, mesh.completion_ratio),
        *(mesh.completion_cm_observable, mesh.completion_ratio_observable),
        *(mesh.precision[at_5cm], mesh.f1[at_5cm]),
    )
    return dict(zip(_MESH_KEYS, values, strict=True))


def _mean(values: Sequence[float | None]) -> float | None:
    measured = [value for value in values if value is not None]
    return float(np.mean(measured)) if measured else None
