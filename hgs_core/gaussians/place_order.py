"""The order in which neighbours in space become neighbours in memory."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Float32, Int
from numpy import ndarray

_CELL_M: Final = 0.25


def place_order(points_m: Float32[ndarray, "n 3"]) -> Int[ndarray, " n"]:
    """Order along a Morton curve of 25 cm cells, so that blocks of the map stay compact."""
    if len(points_m) == 0:
        return np.zeros(0, np.int64)
    cells = np.floor((points_m - points_m.min(axis=0)) / _CELL_M).astype(np.int64)
    code = np.zeros(len(cells), np.int64)
    for bit in range(12):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")
