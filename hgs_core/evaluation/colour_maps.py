"""Perceptual colour maps: equal steps of the value look like equal steps, also to the colour-blind.

Anchors are interpolated in OKLab (Ottosson 2020), whose lightness rises evenly from the first to the last, so
that the order survives in grey. Blue to yellow, the axis that all common colour deficiencies keep.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray

_ANCHORS: Final = ("#1b1145", "#31388a", "#2b6a99", "#1f9390", "#4fb573", "#b3cc48", "#fbe96b")

NO_RETURN: Final = (24, 24, 28)
"""Colour of pixels without a measurement."""
BEYOND_RANGE: Final = (58, 60, 70)
"""Colour of pixels with nothing within range."""


def colourise(values: Float[ndarray, "*shape"]) -> UInt8[ndarray, "*shape 3"]:
    """Colours of `values`, clipped to 0..1; NaN counts as 0."""
    positions = np.nan_to_num(np.clip(values, 0.0, 1.0), nan=0.0)
    return ramp()[(positions * 255.0 + 0.5).astype(np.uint8)]


def colourise_depth(
    depth_m: Float32[ndarray, "h w"], *, near_m: float = 0.3, far_m: float = 5.0
) -> UInt8[ndarray, "h w 3"]:
    """Near is bright. 0 (no return) and +inf (nothing within range) get dark colours of their own."""
    measured = np.isfinite(depth_m) & (depth_m > 0)
    shares = np.where(measured, (depth_m - near_m) / (far_m - near_m), 0.0)
    image = colourise(1.0 - shares)
    image[depth_m == 0] = NO_RETURN
    image[np.isinf(depth_m)] = BEYOND_RANGE
    return image


def colourise_log(values: Float32[ndarray, "h w"], *, decades: float = 3.0) -> UInt8[ndarray, "h w 3"]:
    """`values` >= 0 on a logarithmic scale: the 99th percentile is brightest, `decades` below it darkest."""
    finite = values[np.isfinite(values) & (values > 0)]
    if len(finite) == 0:
        return np.broadcast_to(np.array(NO_RETURN, np.uint8), (*values.shape, 3)).copy()
    top = float(np.log10(np.percentile(finite, 99)))
    positive = np.isfinite(values) & (values > 0)
    logs = np.log10(np.where(positive, values, 1.0))
    image = colourise((logs - (top - decades)) / decades)
    image[~positive] = NO_RETURN
    return image


@cache
def ramp() -> UInt8[ndarray, "256 3"]:
    """The colour map, dark to bright."""
    anchors = np.array([[int(code[k : k + 2], 16) for k in (1, 3, 5)] for code in _ANCHORS]) / 255.0
    lab = _oklab_from_linear(_linear_from_srgb(anchors))
    lab[:, 0] = np.linspace(lab[0, 0], lab[-1, 0], len(lab))
    places = np.linspace(0.0, 1.0, len(lab))
    wanted = np.linspace(0.0, 1.0, 256)
    mixed = np.stack([np.interp(wanted, places, lab[:, channel]) for channel in range(3)], axis=1)
    srgb = _srgb_from_linear(np.clip(_linear_from_oklab(mixed), 0.0, 1.0))
    return (srgb * 255.0 + 0.5).astype(np.uint8)


_LMS: Final = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_LAB: Final = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def _oklab_from_linear(rgb: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    return np.cbrt(rgb @ _LMS.T) @ _LAB.T


def _linear_from_oklab(lab: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    return (lab @ np.linalg.inv(_LAB).T) ** 3 @ np.linalg.inv(_LMS).T


def _linear_from_srgb(srgb: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _srgb_from_linear(linear: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
