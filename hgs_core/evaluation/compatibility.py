"""What two public evaluators print for a map: only for standing beside figures that were made with them.

Neither measures what its names say, so that none of these figures is comparable with the strict ones. Their
point sets are ours: the centres of all Gaussians, and samples of the true surface.

- *NARUTO* (and what uses its evaluation) hands the true mesh over where the evaluator expects the
  reconstruction, and the reconstruction in place of the truth. Its accuracy is completion, its completion is
  accuracy, and its completion ratio is precision: a map of one perfect wall has a completion ratio of 1.
- *ActiveGAMER* thins true points and predictions to one a voxel of 1 cm and then replaces all predictions
  by those that are nearest to the centre of some true point's voxel. A prediction that is far from the
  surface is nearest to none, so that floaters never count, however many.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from hgs_core.evaluation.surface import COMPLETION_THRESHOLD_M, THRESHOLDS_CM, SurfaceMetrics

ACTIVEGAMER_VOXEL_M: Final = 0.01


@dataclass(frozen=True, kw_only=True)
class CompatibilityMetrics:
    """Under the names that the evaluator gives them; NaN where there is nothing to measure."""

    accuracy_cm: float
    completion_cm: float
    completion_ratio: float


def naruto_metrics(strict: SurfaceMetrics) -> CompatibilityMetrics:
    """The strict figures under the names that they get with both point sets swapped."""
    return CompatibilityMetrics(
        accuracy_cm=strict.completion_cm,
        completion_cm=strict.accuracy_cm_to_samples,
        completion_ratio=strict.precision_to_samples[THRESHOLDS_CM.index(5)],
    )


def activegamer_metrics(
    points: Float[ndarray, "n 3"], samples: Float[ndarray, "m 3"], *, voxel_m: float = ACTIVEGAMER_VOXEL_M
) -> CompatibilityMetrics:
    """Reconstruction `points` and ground-truth `samples` [m] as ActiveGAMER's evaluator compares them."""
    if len(points) == 0:
        return CompatibilityMetrics(accuracy_cm=np.nan, completion_cm=np.nan, completion_ratio=0.0)
    truth = _one_a_voxel(np.asarray(samples, dtype=float), voxel_m)
    predictions = _one_a_voxel(np.asarray(points, dtype=float), voxel_m)
    voxel_centres = (np.floor(truth / voxel_m) + 0.5) * voxel_m
    replaced = predictions[_tree(predictions).query(voxel_centres)[1]]
    to_truth = np.asarray(_tree(truth).query(replaced)[0])
    to_replaced = np.asarray(_tree(np.unique(replaced, axis=0)).query(truth)[0])
    return CompatibilityMetrics(
        accuracy_cm=100 * float(to_truth.mean()),
        completion_cm=100 * float(to_replaced.mean()),
        completion_ratio=float(np.mean(to_replaced < COMPLETION_THRESHOLD_M)),
    )


def _tree(points: Float[ndarray, "n 3"]) -> cKDTree:
    return cKDTree(points, balanced_tree=False, compact_nodes=False)


def _one_a_voxel(points: Float[ndarray, "n 3"], voxel_m: float) -> Float[ndarray, "k 3"]:
    """Of the points in each voxel the one nearest to its centre."""
    voxels = np.floor(points / voxel_m)
    away = np.square(points - (voxels + 0.5) * voxel_m).sum(axis=1)
    order = np.lexsort((away, _keys(voxels.astype(np.int64))))
    keys = _keys(voxels.astype(np.int64))[order]
    return points[order[np.concatenate([[True], keys[1:] != keys[:-1]])]]


def _keys(voxels: Int[ndarray, "n 3"]) -> Int[ndarray, " n"]:
    """One number for each voxel."""
    lower, span = voxels.min(axis=0), np.ptp(voxels, axis=0) + 1
    offset = voxels - lower
    return (offset[:, 0] * span[1] + offset[:, 1]) * span[2] + offset[:, 2]
