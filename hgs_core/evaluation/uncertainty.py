"""Does a prediction of error rank the places of an image as their true errors do?

Two figures for each image, over the means of 8 x 8 pixels (single pixels differ by chance alone):

- Spearman's rank correlation of prediction and error; a constant has 0.
- The sparsification error (AUSE): drop the places predicted worst one after another, and watch the mean error
  of what is left, as a share of the whole image's. The area between that curve and the curve of the best
  possible order; 0 is perfect. A constant leaves the mean as it is, so its curve is 1 everywhere.

Source of the second: Ilg et al., "Uncertainty estimates and multi-hypotheses networks for optical flow",
ECCV 2018.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.stats import rankdata

BLOCK_PX: Final = 8
_MIN_BLOCKS: Final = 20
"""Fewer places than this have no order worth a figure."""


@dataclass(frozen=True, kw_only=True)
class PredictionScore:
    """How well one predictor ranks the errors of one image; NaN where there is too little to rank."""

    correlation: float
    """Spearman's, -1 to 1."""
    sparsification_error: float


def block_means(
    values: Float[ndarray, "height width"], mask: Bool[ndarray, "height width"]
) -> Float[ndarray, " n_blocks"]:
    """Means over the masked pixels of blocks of `BLOCK_PX` a side of which at least half are masked.

    Rows and columns that do not fill a block are left out.
    """
    height, width = (size // BLOCK_PX for size in values.shape)

    def sums(image: ndarray) -> ndarray:
        whole = image[: height * BLOCK_PX, : width * BLOCK_PX]
        return whole.reshape(height, BLOCK_PX, width, BLOCK_PX).sum(axis=(1, 3), dtype=float)

    n_pixels = sums(mask)
    enough = n_pixels >= BLOCK_PX**2 / 2
    return sums(np.where(mask, values, 0.0))[enough] / n_pixels[enough]


def prediction_score(
    predicted: Float[ndarray, "height width"],
    error: Float[ndarray, "height width"],
    mask: Bool[ndarray, "height width"],
) -> PredictionScore:
    """Rank the places of an image by `predicted` error and compare with their true `error`, under `mask`."""
    predictions, errors = block_means(predicted, mask), block_means(error, mask)
    if len(errors) < _MIN_BLOCKS or not errors.any():
        return PredictionScore(correlation=float("nan"), sparsification_error=float("nan"))
    return PredictionScore(
        correlation=spearman(predictions, errors),
        sparsification_error=sparsification_error(predictions, errors),
    )


def spearman(a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> float:
    """Rank correlation; 0 where one of the two is constant, which ranks nothing."""
    ranks_a, ranks_b = rankdata(a) - (len(a) + 1) / 2, rankdata(b) - (len(b) + 1) / 2
    norm = float(np.sqrt(np.sum(ranks_a**2) * np.sum(ranks_b**2)))
    return float(np.sum(ranks_a * ranks_b)) / norm if norm > 0 else 0.0


def sparsification_error(predicted: Float[ndarray, " n"], errors: Float[ndarray, " n"]) -> float:
    """Area between the sparsification curves by `predicted` and by the errors themselves."""
    return float(np.mean(_curve(predicted, errors) - _curve(errors, errors)))


def _curve(predicted: Float[ndarray, " n"], errors: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Mean error of what is left after dropping 0, 1, ... n - 1 of the worst, over the mean of all."""
    # Equal predictions say nothing of the order among them: each counts with their mean.
    _, group = np.unique(-predicted, return_inverse=True)
    expected = np.bincount(group, weights=errors) / np.bincount(group)
    worst_first = expected[np.sort(group)]
    left = np.cumsum(worst_first[::-1])[::-1] / np.arange(len(errors), 0, -1)
    return left / errors.mean()
