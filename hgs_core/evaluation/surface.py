"""Surface metrics: Gaussian centres against the ground-truth surface.

Accuracy, completion and completion ratio are those of HGS-Planner section IV-B, without clipping and without
thinning: every Gaussian centre counts, so floaters show. Distances from the reconstruction go to the true
surface itself; going to its 300 000 samples instead, as public evaluators do, adds half the samples'
spacing (1 to 2 cm in a house) and is given in a column of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import cKDTree

THRESHOLDS_CM: Final = (1, 2, 5, 10)
COMPLETION_THRESHOLD_M: Final = 0.05
OPAQUE: Final = 0.5
"""Opacity from which a Gaussian counts as opaque."""
N_SAMPLES: Final = 300_000
SAMPLE_SEED: Final = 20_240_901

DistanceToSurface = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]
"""Unsigned distance [m] of points to the true surface."""


def sample_surface(
    vertices: Float[ndarray, "v 3"],
    triangles: ndarray,
    *,
    n_samples: int = N_SAMPLES,
    seed: int = SAMPLE_SEED,
) -> Float[ndarray, "n 3"]:
    """`n_samples` points spread evenly over the triangles' area (`triangles` is an integer array (t, 3)).

    Stratified along the cumulated area (one sample in each of `n_samples` equal shares), which keeps every
    face's share within one sample of its area's.
    """
    rng = np.random.default_rng(seed)
    a, b, c = (vertices[triangles[:, corner]].astype(float) for corner in range(3))
    cumulated = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    strata = (np.arange(n_samples) + rng.random(n_samples)) / n_samples * cumulated[-1]
    face = np.minimum(np.searchsorted(cumulated, strata, side="right"), len(triangles) - 1)
    root, share = np.sqrt(rng.random(n_samples)), rng.random(n_samples)
    weights = np.stack([1.0 - root, root * (1.0 - share), root * share], axis=1)
    return weights[:, :1] * a[face] + weights[:, 1:2] * b[face] + weights[:, 2:] * c[face]


@dataclass(frozen=True, kw_only=True)
class SurfaceMetrics:
    """One reconstruction against one ground truth; NaN where there are no points to measure.

    `precision`, `recall` and `f1` stand at `THRESHOLDS_CM`, in that order.
    """

    n_points: int
    accuracy_cm: float
    """Mean distance of the reconstruction's points to the true surface."""
    accuracy_cm_to_samples: float
    """The same to the nearest ground-truth sample."""
    completion_cm: float
    """Mean distance of the ground-truth samples to the nearest point of the reconstruction."""
    completion_ratio: float
    """Share of ground-truth samples closer than 5 cm."""
    completion_cm_observable: float
    """Completion over the observable samples alone."""
    completion_ratio_observable: float
    """Completion ratio over the observable samples alone."""
    precision: tuple[float, ...]
    """Share of the reconstruction's points closer to the true surface than each threshold."""
    precision_to_samples: tuple[float, ...]
    """The same to the nearest ground-truth sample."""
    recall: tuple[float, ...]
    """Share of ground-truth samples closer to the reconstruction than each threshold."""
    f1: tuple[float, ...]
    """Harmonic mean of precision and recall."""


def surface_metrics(
    points: Float[ndarray, "n 3"],
    *,
    samples: Float[ndarray, "m 3"],
    observable: Bool[ndarray, " m"],
    distance_to_surface: DistanceToSurface,
) -> SurfaceMetrics:
    """Compare reconstruction `points` [m] with ground-truth `samples` [m].

    An empty reconstruction completes nothing: ratios are 0 and distances NaN.
    """
    if len(points) == 0:
        nothing = (0.0,) * len(THRESHOLDS_CM)
        return SurfaceMetrics(
            n_points=0,
            accuracy_cm=float("nan"),
            accuracy_cm_to_samples=float("nan"),
            completion_cm=float("nan"),
            completion_ratio=0.0,
            completion_cm_observable=float("nan"),
            completion_ratio_observable=0.0,
            precision=nothing,
            precision_to_samples=nothing,
            recall=nothing,
            f1=nothing,
        )
    points = np.asarray(points, dtype=float)
    to_surface = distance_to_surface(points)
    to_samples = _nearest(samples, points)
    to_points = _nearest(points, samples)
    precision = tuple(_share_below(to_surface, cm / 100) for cm in THRESHOLDS_CM)
    recall = tuple(_share_below(to_points, cm / 100) for cm in THRESHOLDS_CM)
    seen = to_points[observable]
    return SurfaceMetrics(
        n_points=len(points),
        accuracy_cm=_mean_cm(to_surface),
        accuracy_cm_to_samples=_mean_cm(to_samples),
        completion_cm=_mean_cm(to_points),
        completion_ratio=_share_below(to_points, COMPLETION_THRESHOLD_M),
        completion_cm_observable=_mean_cm(seen),
        completion_ratio_observable=_share_below(seen, COMPLETION_THRESHOLD_M),
        precision=precision,
        precision_to_samples=tuple(_share_below(to_samples, cm / 100) for cm in THRESHOLDS_CM),
        recall=recall,
        f1=tuple(2 * p * r / (p + r) if p + r > 0 else 0.0 for p, r in zip(precision, recall, strict=True)),
    )


def _nearest(targets: Float[ndarray, "m 3"], queries: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Distance [m] of each query to the nearest target."""
    tree = cKDTree(targets, balanced_tree=False, compact_nodes=False)
    return np.asarray(tree.query(queries, workers=-1)[0])


def _share_below(distances: Float[ndarray, " n"], threshold_m: float) -> float:
    return float(np.mean(distances < threshold_m)) if len(distances) else float("nan")


def _mean_cm(distances: Float[ndarray, " n"]) -> float:
    return float(np.mean(distances, dtype=float)) * 100 if len(distances) else float("nan")
