"""How alike two images are: PSNR, SSIM, over all pixels or a mask.

Colours are in 0..1. A figure over no pixels is NaN; PSNR of equal images is +inf.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32
from numpy import ndarray
from scipy.ndimage import correlate1d

_WINDOW: Final = 11
_SIGMA: Final = 1.5
_C1: Final = 0.01**2
_C2: Final = 0.03**2


def psnr_db(
    image: Float[ndarray, "h w 3"],
    reference: Float[ndarray, "h w 3"],
    mask: Bool[ndarray, "h w"] | None = None,
) -> float:
    """Peak signal-to-noise ratio [dB] over the pixels of `mask` (all without one)."""
    error = (image - reference) ** 2
    values = error if mask is None else error[mask]
    if values.size == 0:
        return float("nan")
    mean = float(np.mean(values, dtype=float))
    return float("inf") if mean == 0 else -10.0 * float(np.log10(mean))


def ssim_map(image: Float[ndarray, "h w 3"], reference: Float[ndarray, "h w 3"]) -> Float32[ndarray, "h w"]:
    """Structural similarity at every pixel, mean of the three channels.

    Wang et al. 2004: Gaussian window of 11 pixels, sigma 1.5, K1 = 0.01, K2 = 0.03; borders are mirrored. A
    pixel's value takes in its window, so a masked mean reaches up to 5 pixels over the mask's edge.
    """
    total = np.zeros(image.shape[:2], np.float32)
    for channel in range(3):
        x = np.ascontiguousarray(image[..., channel], np.float32)
        y = np.ascontiguousarray(reference[..., channel], np.float32)
        mean_x, mean_y = _blurred(x), _blurred(y)
        # Variances of float32 images in 0..1 are good to about 1e-7, far below C2.
        variances = _blurred(x * x + y * y) - (mean_x * mean_x + mean_y * mean_y)
        covariance = _blurred(x * y) - mean_x * mean_y
        luminance = (2 * mean_x * mean_y + _C1) / (mean_x * mean_x + mean_y * mean_y + _C1)
        total += luminance * (2 * covariance + _C2) / (variances + _C2)
    return total / 3


def masked_mean(values: Float[ndarray, "h w"], mask: Bool[ndarray, "h w"] | None = None) -> float:
    chosen = values if mask is None else values[mask]
    return float(np.mean(chosen, dtype=float)) if chosen.size else float("nan")


def _blurred(channel: Float32[ndarray, "h w"]) -> Float32[ndarray, "h w"]:
    offsets = np.arange(_WINDOW) - _WINDOW // 2
    weights = np.exp(-0.5 * (offsets / _SIGMA) ** 2)
    weights /= weights.sum()
    return correlate1d(correlate1d(channel, weights, axis=1, mode="mirror"), weights, axis=0, mode="mirror")
