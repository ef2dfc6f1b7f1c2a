"""How far the robot may still drive, and whether that lasts for the way back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.planning.directives import Directives
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import ReachField, reach_from

RESERVE_SHARE: Final = 0.05
RESERVE_M: Final = 0.5
"""Kept beyond the known way back, in proportion to it and besides: the map may still change on the way."""

_ROUNDING_M: Final = 0.05
"""A smoothed way may be so much longer than the cells that it leads over."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PathBudget:
    """A path length [m] at which the mission must be over, at its start where it has to return."""

    max_path_m: float
    return_to_m: Float[ndarray, " 2"] | None

    @staticmethod
    def of(directives: Directives, start_xy_m: Float[ndarray, " 2"]) -> PathBudget | None:
        """None where the path has no limit."""
        if directives.max_path_m is None:
            return None
        return PathBudget(
            max_path_m=directives.max_path_m,
            return_to_m=start_xy_m if directives.return_to_start else None,
        )

    def affords(self, grid: NavigationGrid, reach: ReachField, driven_m: float) -> Bool[ndarray, "nx ny"]:
        """Cells that the robot can drive to, and back from, with what is left after `driven_m`."""
        needed = reach.lengths_m(grid) + _ROUNDING_M
        if self.return_to_m is not None:
            needed = needed + with_reserve(reach_from(grid, self.return_to_m).lengths_m(grid))
        affords: Bool[ndarray, "nx ny"] = (needed <= self.max_path_m - driven_m).reshape(grid.shape)
        return affords


def with_reserve(way_back_m: Float[ndarray, "*shape"]) -> Float[ndarray, "*shape"]:
    """What is set aside for a way back of that length."""
    kept: Float[ndarray, "*shape"] = (1.0 + RESERVE_SHARE) * np.asarray(way_back_m) + RESERVE_M
    return kept
