"""The tracker against measuring everything at every reading, and the levels of a curve by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from hgs_core.evaluation.completion_curve import CompletionTracker, path_m_at, time_s_at
from hgs_core.evaluation.report_parts import CurvePoint


def floor_samples(n: int, rng: np.random.Generator) -> np.ndarray:
    return np.stack([rng.uniform(-2, 2, n), rng.uniform(0, 3, n), np.zeros(n)], axis=1)


@given(st.integers(0, 2**32 - 1))
def test_every_reading_equals_a_full_recomputation(seed: int) -> None:
    """A map that grows, moves and loses Gaussians, some far outside of the samples' box."""
    rng = np.random.default_rng(seed)
    samples = floor_samples(400, rng)
    tracker = CompletionTracker(samples)
    complete = np.zeros(len(samples), dtype=bool)
    centres = np.zeros((0, 3), np.float32)
    for _ in range(6):
        added = floor_samples(60, rng) + rng.normal(0, 0.02, (60, 3))
        added[:3] = rng.uniform(-50, 50, (3, 3))
        centres = np.concatenate([centres, added.astype(np.float32)])
        centres = centres[rng.random(len(centres)) < 0.9] + rng.normal(0, 0.005, 3).astype(np.float32)
        complete |= cKDTree(centres).query(samples)[0] < 0.05
        assert tracker.read(centres) == pytest.approx(complete.mean(), abs=1e-12)
    assert 0 < tracker.ratio < 1


def test_the_threshold_itself_is_not_complete() -> None:
    samples = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    tracker = CompletionTracker(samples, threshold_m=0.25)
    assert tracker.read(np.array([[0.25, 0.0, 0.0], [1.0, 0.0, 0.24]])) == 0.5


def test_what_was_complete_stays_complete() -> None:
    samples = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    tracker = CompletionTracker(samples)
    assert tracker.read(np.zeros((0, 3))) == 0.0
    assert tracker.read(samples[:1]) == 0.5
    assert tracker.read(samples[1:]) == 1.0
    assert tracker.read(np.zeros((0, 3))) == 1.0


def test_nothing_observable_is_never_complete() -> None:
    assert CompletionTracker(np.zeros((0, 3))).read(np.zeros((5, 3))) == 0.0


def test_a_world_too_large_for_fine_cells_is_measured_all_the_same() -> None:
    """3 x 3 x 3 km would be 27e12 cells of 10 cm."""
    samples = np.array([[0.0, 0.0, 0.0], [3000.0, 3000.0, 3000.0], [1500.0, 0.0, 0.0]])
    tracker = CompletionTracker(samples)
    assert tracker.read(samples[:2] + 0.01) == pytest.approx(2 / 3)


CURVE = [
    CurvePoint(path_m=0.0, time_s=2.0, ratio=0.3),
    CurvePoint(path_m=10.0, time_s=30.0, ratio=0.8),
    CurvePoint(path_m=20.0, time_s=50.0, ratio=1.0),
    CurvePoint(path_m=25.0, time_s=60.0, ratio=0.85),
]


def test_levels_lie_between_readings() -> None:
    assert path_m_at(CURVE, 0.9) == pytest.approx(15.0)
    assert time_s_at(CURVE, 0.9) == pytest.approx(40.0)
    assert path_m_at(CURVE, 0.8) == pytest.approx(10.0)
    assert path_m_at(CURVE, 0.2) == 0.0


def test_a_level_never_reached_has_no_length() -> None:
    assert path_m_at(CURVE[:2], 0.9) is None
    assert time_s_at([], 0.9) is None
