"""Holes in depth images: blobs where a sensor got nothing back, as from glass, gloss or black cloth."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.errors import ConfigError

_RADII: Final = (0.02, 0.08)
"""Of the image's width; evenly spread."""


class DepthHoles:
    """Discs without a return (depth 0), at random places: a Boolean model, whose expected cover is
    `1 - exp(-n a)` for `n` discs of mean area `a` to the unit of area."""

    def __init__(self, share: float, rng: np.random.Generator) -> None:
        """`share` of the pixels is missing on average. Raises `ConfigError` for none such."""
        if not 0.0 <= share < 1.0:
            raise ConfigError(f"depth holes {share}: expected a share of at least 0 and below 1")
        self._share = share
        self._rng = rng

    def punched(self, depth_m: Float32[ndarray, "height width"]) -> Float32[ndarray, "height width"]:
        """Z-depth [m] with the holes of this image."""
        if self._share == 0.0:
            return depth_m
        height, width = depth_m.shape
        least, most = _RADII[0] * width, _RADII[1] * width
        mean_area = math.pi / 3.0 * (least * least + least * most + most * most)
        # Discs whose centres lie beyond the border reach into the image: the borders are no exception.
        area = (height + 2.0 * most) * (width + 2.0 * most)
        n = int(self._rng.poisson(-math.log1p(-self._share) * area / mean_area))
        radii = self._rng.uniform(least, most, n)
        rows = self._rng.uniform(-most, height + most, n)
        columns = self._rng.uniform(-most, width + most, n)
        punched = depth_m.copy()
        for row, column, radius in zip(rows, columns, radii, strict=True):
            top, bottom = max(math.ceil(row - radius), 0), min(math.floor(row + radius) + 1, height)
            left, right = max(math.ceil(column - radius), 0), min(math.floor(column + radius) + 1, width)
            if top >= bottom or left >= right:
                continue
            away = (np.arange(top, bottom)[:, None] - row) ** 2 + (np.arange(left, right) - column) ** 2
            punched[top:bottom, left:right][away <= radius * radius] = 0.0
        return punched
