"""Axis-aligned boxes in the world frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.errors import ConfigError


@dataclass(frozen=True, kw_only=True, eq=False)
class Box:
    """The half-open box `[lower_m, upper_m)`."""

    lower_m: Float[ndarray, " 3"]
    upper_m: Float[ndarray, " 3"]

    def __post_init__(self) -> None:
        if not np.all(self.lower_m < self.upper_m):
            raise ConfigError(f"box needs lower < upper on every axis, got {self.lower_m} .. {self.upper_m}")

    @property
    def size_m(self) -> Float[ndarray, " 3"]:
        return self.upper_m - self.lower_m

    @property
    def centre_m(self) -> Float[ndarray, " 3"]:
        return (self.lower_m + self.upper_m) / 2

    def contains(self, points: Float[ndarray, "*points 3"]) -> Bool[ndarray, "*points"]:
        inside: Bool[ndarray, "*points"] = np.all((points >= self.lower_m) & (points < self.upper_m), axis=-1)
        return inside

    def expanded(self, margin_m: float) -> Box:
        return Box(lower_m=self.lower_m - margin_m, upper_m=self.upper_m + margin_m)
