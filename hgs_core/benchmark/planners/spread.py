"""One figure over the seeds of a planner on a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Mean and sample standard deviation of the seeds that have the figure."""

    mean: float | None
    """None: no seed has it."""
    deviation: float | None
    """Divided by n - 1; None for less than two seeds."""
    n: int
    asked: int
    """Seeds that the grid asks for: more than `n` where cells are missing."""
    missing: str = ""
    """In a word, what became of the seeds that lack it."""

    @staticmethod
    def of(values: Sequence[float | None], *, missing: str = "") -> Spread:
        """`values` of all seeds that were asked for; None where there is none."""
        known = [value for value in values if value is not None]
        return Spread(
            mean=float(np.mean(known)) if known else None,
            deviation=float(np.std(known, ddof=1)) if len(known) > 1 else None,
            n=len(known),
            asked=len(values),
            missing=missing,
        )

    @property
    def is_whole(self) -> bool:
        return self.n == self.asked > 0

    def text(self, decimals: int) -> str:
        """As tables print it: `mean ± deviation`, and behind it how many seeds are missing, and why."""
        if self.asked == 0:
            return "–"
        if self.mean is None:
            return self.missing
        number = f"{self.mean:.{decimals}f}"
        if self.deviation is not None:
            number += f" ± {self.deviation:.{decimals}f}"
        return number if self.is_whole else f"{number} [{self.n} of {self.asked}: {self.missing}]"
