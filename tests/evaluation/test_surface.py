"""Surface sampling and surface metrics on a unit square at z = 0."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Float
from numpy import ndarray

from hgs_core.evaluation.surface import THRESHOLDS_CM, sample_surface, surface_metrics

SQUARE_VERTICES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
SQUARE_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)


def distance_to_square(points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    outside = np.maximum(np.maximum(-points[:, :2], points[:, :2] - 1), 0)
    return np.linalg.norm(np.concatenate([outside, points[:, 2:]], axis=1), axis=1)


def measure(points: Float[ndarray, "n 3"], observable_left_half: bool = False):
    samples = sample_surface(SQUARE_VERTICES, SQUARE_TRIANGLES, n_samples=20_000)
    observable = samples[:, 0] < 0.5 if observable_left_half else np.ones(len(samples), bool)
    return surface_metrics(
        points, samples=samples, observable=observable, distance_to_surface=distance_to_square
    )


def test_samples_lie_on_the_triangles_and_spread_by_area() -> None:
    vertices = np.concatenate([SQUARE_VERTICES, SQUARE_VERTICES * 2 + [5, 0, 1]])
    triangles = np.concatenate([SQUARE_TRIANGLES, SQUARE_TRIANGLES + 4])
    samples = sample_surface(vertices, triangles, n_samples=5000)
    small = samples[:, 0] < 2
    np.testing.assert_allclose(samples[:, 2], np.where(small, 0.0, 1.0), atol=1e-12)
    assert small.mean() == pytest.approx(1 / 5, abs=1 / 5000)
    # Evenly within a face, too: quadrant counts of 1000 agree within 5 standard deviations.
    quadrants = np.histogram2d(samples[small, 0], samples[small, 1], bins=2, range=[[0, 1], [0, 1]])[0]
    assert np.all(np.abs(quadrants - 250) < 70)


def test_sampling_repeats_and_ignores_degenerate_triangles() -> None:
    triangles = np.concatenate([SQUARE_TRIANGLES, [[0, 0, 1], [2, 2, 2]]])
    plain = sample_surface(SQUARE_VERTICES, SQUARE_TRIANGLES, n_samples=1000)
    np.testing.assert_array_equal(plain, sample_surface(SQUARE_VERTICES, triangles, n_samples=1000))
    assert not np.array_equal(plain, sample_surface(SQUARE_VERTICES, triangles, n_samples=1000, seed=1))


def test_a_perfect_dense_reconstruction() -> None:
    grid = np.linspace(0, 1, 101)
    points = np.stack([*(axis.ravel() for axis in np.meshgrid(grid, grid)), np.zeros(101**2)], axis=1)
    metrics = measure(points)
    assert metrics.accuracy_cm == 0
    assert metrics.completion_ratio == metrics.completion_ratio_observable == 1
    assert metrics.completion_cm < 0.5
    assert metrics.precision == metrics.recall == metrics.f1 == (1, 1, 1, 1)


def test_a_lifted_half_by_hand() -> None:
    """The left half, 3 cm above the square: accuracy 3 cm; half of the samples within 5 cm.

    Completion at x in the right half is sqrt((x - 0.5)^2 + 0.03^2); its mean with the left half's 3 cm
    follows from the integral.
    """
    grid_x, grid_y = np.meshgrid(np.linspace(0, 0.5, 101), np.linspace(0, 1, 201))
    points = np.stack([grid_x.ravel(), grid_y.ravel(), np.full(grid_x.size, 0.03)], axis=1)
    metrics = measure(points, observable_left_half=True)
    assert metrics.accuracy_cm == pytest.approx(3)
    assert metrics.precision == (0, 0, 1, 1)
    assert metrics.recall[1] == 0
    assert metrics.recall[2] == pytest.approx(0.5 + 0.04, abs=0.005)  # sqrt(5^2 - 3^2) = 4 cm into the right
    assert metrics.recall[2] == metrics.completion_ratio
    x = np.linspace(0, 0.5, 10_001)
    right = np.sqrt(x**2 + 0.03**2).mean()
    assert metrics.completion_cm == pytest.approx(50 * (0.03 + right), rel=0.01)
    assert metrics.completion_cm_observable == pytest.approx(3, abs=0.02)
    assert metrics.completion_ratio_observable == 1
    p, r = metrics.precision[2], metrics.recall[2]
    assert metrics.f1[2] == pytest.approx(2 * p * r / (p + r))


def test_floaters_count_in_accuracy_and_leave_completion_alone() -> None:
    near = np.array([[0.5, 0.5, 0.0]])
    both = np.concatenate([near, [[0.5, 0.5, 1.0]]])
    assert measure(both).accuracy_cm == pytest.approx(50)
    assert measure(both).completion_cm == pytest.approx(measure(near).completion_cm)


@given(st.integers(1, 40), st.integers(0, 1000))
def test_thresholds_are_monotone_and_samples_are_never_nearer_than_the_surface(n: int, seed: int) -> None:
    points = np.random.default_rng(seed).normal(0.5, 0.3, size=(n, 3)) * [1, 1, 0.1]
    samples = sample_surface(SQUARE_VERTICES, SQUARE_TRIANGLES, n_samples=500)
    metrics = surface_metrics(
        points, samples=samples, observable=np.ones(500, bool), distance_to_surface=distance_to_square
    )
    assert list(metrics.precision) == sorted(metrics.precision)
    assert list(metrics.recall) == sorted(metrics.recall)
    assert metrics.accuracy_cm <= metrics.accuracy_cm_to_samples + 1e-9


def test_an_empty_map_completes_nothing() -> None:
    metrics = measure(np.zeros((0, 3)))
    assert metrics.completion_ratio == 0
    assert np.isnan(metrics.accuracy_cm)
    assert len(metrics.f1) == len(THRESHOLDS_CM)


def test_nothing_observable_is_not_a_number() -> None:
    samples = sample_surface(SQUARE_VERTICES, SQUARE_TRIANGLES, n_samples=100)
    metrics = surface_metrics(
        np.array([[0.5, 0.5, 0.0]]),
        samples=samples,
        observable=np.zeros(100, bool),
        distance_to_surface=distance_to_square,
    )
    assert np.isnan(metrics.completion_ratio_observable)
    assert np.isnan(metrics.completion_cm_observable)
