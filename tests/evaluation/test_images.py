"""PSNR and SSIM: closed forms, symmetries, and a naive oracle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.evaluation.images import masked_mean, psnr_db, ssim_map


def random_image(seed: int, height: int = 24, width: int = 31) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)


def test_psnr_of_a_constant_error_by_hand() -> None:
    """An error of 0.1 everywhere: 10 log10(1 / 0.01) = 20 dB."""
    image = np.full((4, 5, 3), 0.5)
    assert psnr_db(image + 0.1, image) == pytest.approx(20.0)
    assert psnr_db(image, image) == float("inf")


def test_psnr_counts_masked_pixels_only() -> None:
    image, reference = np.zeros((4, 4, 3)), np.zeros((4, 4, 3))
    image[:2] = 0.1
    image[2:] = 1.0
    mask = np.zeros((4, 4), bool)
    mask[:2] = True
    assert psnr_db(image, reference, mask) == pytest.approx(20.0)
    assert psnr_db(image, reference, ~mask) == pytest.approx(0.0)
    assert np.isnan(psnr_db(image, reference, np.zeros((4, 4), bool)))


@given(st.integers(0, 1000))
def test_ssim_is_one_for_equal_images_symmetric_and_at_most_one(seed: int) -> None:
    image, other = random_image(seed), random_image(seed + 1)
    np.testing.assert_allclose(ssim_map(image, image), 1.0, atol=1e-4)
    np.testing.assert_allclose(ssim_map(image, other), ssim_map(other, image), atol=1e-4)
    assert ssim_map(image, other).max() <= 1 + 1e-4


def test_ssim_of_constant_images_by_hand() -> None:
    """Without variance only luminance is left: (2ab + C1) / (a^2 + b^2 + C1)."""
    a, b = 0.2, 0.8
    expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4)
    values = ssim_map(np.full((20, 20, 3), a, np.float32), np.full((20, 20, 3), b, np.float32))
    np.testing.assert_allclose(values, expected, rtol=1e-3)


def test_ssim_against_the_definition_at_one_pixel() -> None:
    """Away from borders: weighted moments over the 11 x 11 window, straight from Wang et al."""
    image, other = random_image(0), random_image(1)
    row, column = 12, 15
    offsets = np.arange(-5, 6)
    weights = np.exp(-0.5 * (offsets / 1.5) ** 2)
    window = np.outer(weights, weights) / np.outer(weights, weights).sum()
    values = []
    for channel in range(3):
        x, y = (
            img[row - 5 : row + 6, column - 5 : column + 6, channel].astype(float) for img in (image, other)
        )
        mx, my = (window * x).sum(), (window * y).sum()
        vx, vy = (window * (x - mx) ** 2).sum(), (window * (y - my) ** 2).sum()
        cov = (window * (x - mx) * (y - my)).sum()
        values.append((2 * mx * my + 1e-4) * (2 * cov + 9e-4) / ((mx**2 + my**2 + 1e-4) * (vx + vy + 9e-4)))
    assert ssim_map(image, other)[row, column] == pytest.approx(np.mean(values), abs=1e-5)


def test_a_mean_over_nothing_is_not_a_number() -> None:
    assert np.isnan(masked_mean(np.ones((2, 2)), np.zeros((2, 2), bool)))
    assert masked_mean(np.arange(4.0).reshape(2, 2), np.array([[True, False], [False, True]])) == 1.5
