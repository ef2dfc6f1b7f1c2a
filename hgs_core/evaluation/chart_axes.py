"""Round numbers along the axes of charts."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def ticks(lower: float, upper: float) -> Float[ndarray, " n_ticks"]:
    """Round numbers from at most `lower` to at least `upper`, four to seven of them."""
    span = upper - lower if upper > lower else max(abs(upper), 1.0)
    step = 10.0 ** np.floor(np.log10(span / 4))
    step *= next(factor for factor in (1, 2, 2.5, 5, 10) if span / (step * factor) <= 5)
    first, last = np.floor(lower / step), np.ceil((lower + span) / step)
    return np.arange(first, last + 1) * step


def number(value: float) -> str:
    """A tick's label: `12 k`, `3 M`, no trailing zeros."""
    if abs(value) >= 1e6:
        return f"{value / 1e6:g} M"
    return f"{value / 1e3:g} k" if abs(value) >= 1e4 else f"{round(value, 9):g}"
