"""Both evaluators' figures for point sets small enough to measure by eye."""

import numpy as np
import pytest

from hgs_core.evaluation.compatibility import activegamer_metrics, naruto_metrics
from hgs_core.evaluation.surface import surface_metrics

TRUTH = np.array([[0.005, 0.005, 0.005], [1.005, 0.005, 0.005], [2.005, 0.005, 0.005], [3.005, 0.005, 0.005]])
"""Four points, each in the middle of a voxel of 1 cm."""


def test_naruto_swaps_what_is_measured() -> None:
    """The map holds the first true point alone, and a floater 10 cm above it."""
    points = TRUTH[[0, 0]] + np.array([[0, 0, 0], [0, 0, 0.1]])
    strict = surface_metrics(
        points,
        samples=TRUTH,
        observable=np.ones(4, dtype=bool),
        distance_to_surface=lambda query: np.zeros(len(query)),
    )
    swapped = naruto_metrics(strict)
    assert swapped.accuracy_cm == pytest.approx((0 + 100 + 200 + 300) / 4)
    assert swapped.completion_cm == pytest.approx((0 + 10) / 2)
    assert swapped.completion_ratio == pytest.approx(1 / 2)
    assert strict.completion_ratio == pytest.approx(1 / 4)


def test_naruto_calls_a_map_of_almost_nothing_complete() -> None:
    strict = surface_metrics(
        TRUTH[:1],
        samples=TRUTH,
        observable=np.ones(4, dtype=bool),
        distance_to_surface=lambda query: np.zeros(len(query)),
    )
    assert naruto_metrics(strict).completion_ratio == 1.0


def test_activegamer_never_sees_floaters() -> None:
    """One prediction 2 cm above each true point; a thousand floaters a metre up change nothing."""
    near = TRUTH + np.array([0, 0, 0.02])
    floaters = np.random.default_rng(0).uniform([0, 0, 1], [3, 3, 2], (1000, 3))
    clean = activegamer_metrics(near, TRUTH)
    assert clean.accuracy_cm == pytest.approx(2.0)
    assert clean.completion_cm == pytest.approx(2.0)
    assert clean.completion_ratio == 1.0
    assert activegamer_metrics(np.concatenate([near, floaters]), TRUTH) == clean


def test_activegamer_counts_a_prediction_once_for_every_true_point_that_it_is_nearest_to() -> None:
    """One prediction, 3 cm above the first true point: it stands for all four."""
    metrics = activegamer_metrics(TRUTH[:1] + np.array([0, 0, 0.03]), TRUTH)
    assert metrics.accuracy_cm == pytest.approx(3.0)
    assert metrics.completion_ratio == pytest.approx(1 / 4)
    distances = np.hypot([0, 1, 2, 3], 0.03)
    assert metrics.completion_cm == pytest.approx(100 * distances.mean())


def test_activegamer_thins_both_to_one_a_voxel() -> None:
    """Of two true points in a voxel the one nearer to its middle stands for both; likewise predictions."""
    truth = np.array([[0.005, 0.005, 0.005], [0.009, 0.005, 0.005], [-0.005, 0.005, 0.005]])
    points = np.array([[0.005, 0.005, 0.025], [0.005, 0.005, 0.029]])
    metrics = activegamer_metrics(points, truth)
    assert metrics.accuracy_cm == pytest.approx(2.0)
    assert metrics.completion_cm == pytest.approx(100 * (0.02 + np.hypot(0.01, 0.02)) / 2)


def test_an_empty_map() -> None:
    metrics = activegamer_metrics(np.zeros((0, 3)), TRUTH)
    assert np.isnan(metrics.accuracy_cm)
    assert metrics.completion_ratio == 0.0
