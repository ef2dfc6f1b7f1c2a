"""How well a prediction ranks errors: hand-solved orders, and laws."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.evaluation.uncertainty import (
    BLOCK_PX,
    block_means,
    prediction_score,
    sparsification_error,
    spearman,
)

SEEDS = st.integers(0, 2**32 - 1)


def test_means_are_over_the_masked_pixels_of_blocks_that_are_masked_at_least_by_half() -> None:
    values = np.arange(16 * 20, dtype=float).reshape(16, 20)
    mask = np.ones((16, 20), bool)
    mask[:8, :4] = False  # half of the first block
    mask[8:, :5] = False  # more than half of the third
    blocks = block_means(values, mask)
    assert BLOCK_PX == 8
    # Two rows of two whole blocks; columns 16..19 fill none.
    np.testing.assert_allclose(
        blocks, [values[:8, 4:8].mean(), values[:8, 8:16].mean(), values[8:, 8:16].mean()]
    )


@given(seed=SEEDS)
def test_rank_correlation_knows_only_the_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.random(50), rng.random(50)
    assert spearman(a, a**3) == pytest.approx(1.0)
    assert spearman(a, -np.exp(a)) == pytest.approx(-1.0)
    assert spearman(a, b) == pytest.approx(spearman(b, a))
    assert spearman(a, b) == pytest.approx(spearman(np.log(a), b**5))
    assert spearman(np.ones(50), b) == 0.0


def test_sparsification_by_hand() -> None:
    """Errors 3, 1, 2 (mean 2). By the truth what is left is 2, 1.5, 1; by the reverse order 2, 2.5, 3."""
    errors = np.array([3.0, 1.0, 2.0])
    assert sparsification_error(errors, errors) == 0.0
    assert sparsification_error(-errors, errors) == pytest.approx((0 + 1.0 + 2.0) / 3 / 2.0)
    # A constant leaves the mean, 2, 2, 2.
    assert sparsification_error(np.ones(3), errors) == pytest.approx((0 + 0.5 + 1.0) / 3 / 2.0)


@given(seed=SEEDS)
def test_sparsification_lies_between_perfect_and_reverse_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    errors, predicted = rng.random(40), rng.random(40)
    area = sparsification_error(predicted, errors)
    assert -1e-12 <= area <= sparsification_error(-errors, errors) + 1e-12
    # Neither the scale of the errors nor that of the prediction counts.
    assert area == pytest.approx(sparsification_error(7.0 * predicted - 2.0, 3.0 * errors))


def test_a_constant_is_as_good_as_chance() -> None:
    rng = np.random.default_rng(0)
    errors = rng.random(200)
    by_chance = [sparsification_error(rng.random(200), errors) for _ in range(300)]
    assert sparsification_error(np.ones(200), errors) == pytest.approx(np.mean(by_chance), abs=0.02)


def test_what_is_too_small_or_without_error_has_no_score() -> None:
    error = np.random.default_rng(0).random((64, 64))
    everything = np.ones((64, 64), bool)
    assert prediction_score(error, error, everything).correlation == pytest.approx(1.0)
    for score in (
        prediction_score(error, error, np.zeros((64, 64), bool)),
        prediction_score(error, np.zeros((64, 64)), everything),
    ):
        assert np.isnan([score.correlation, score.sparsification_error]).all()
