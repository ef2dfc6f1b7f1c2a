"""What one planning cycle knows: gathered once, read by the global and the local level."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from hgs_core.geometry.boxes import Box
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import ReachField
from hgs_core.planning.subspaces import MissingColumns
from hgs_core.planning.views import View, ViewScorer
from hgs_core.robot.robot import RobotState


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningCycle:
    """The world as one call of `plan()` sees it."""

    snapshot: MapSnapshot
    robot: RobotState
    grid: NavigationGrid
    reach: ReachField
    places: Int[ndarray, " n_places"]
    """Flat cells where a viewpoint may be: reachable, inside the region."""
    places_m: Float[ndarray, "n_places 2"]
    """Their centres."""
    roomy: Bool[ndarray, " n_places"]
    """Which of them have the preferred clearance."""
    horizon: Box
    missing: MissingColumns
    observed_share: float
    scorer: ViewScorer

    @property
    def robot_xy_m(self) -> Float[ndarray, " 2"]:
        return np.array([self.robot.x_m, self.robot.y_m])

    def score(self, cells: Int[ndarray, " n"]) -> list[View]:
        """Views at cell centres."""
        return self.scorer.score(
            self.snapshot, self.grid.centres_m(cells), [int(c) for c in cells], self.observed_share
        )

    def in_horizon(self, points_m: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
        inside: Bool[ndarray, " n"] = np.all(
            (points_m >= self.horizon.lower_m[:2]) & (points_m < self.horizon.upper_m[:2]), axis=1
        )
        return inside

    def nearest_place(self, point_m: Float[ndarray, " 2"]) -> int:
        """The place nearest to a point; there must be one."""
        return int(self.places[np.argmin(self._squared_distances(point_m))])

    def place_near(self, point_m: Float[ndarray, " 2"], within_m: float) -> int | None:
        """The place nearest to a point, if it is near enough."""
        reach = int(np.ceil(within_m / self.grid.size_m)) + 1
        i, j = (int(k) for k in np.floor((point_m - self.grid.lower_m) / self.grid.size_m))
        first_i, first_j = max(i - reach, 0), max(j - reach, 0)
        window = self._is_place[first_i : max(i + reach + 1, 0), first_j : max(j + reach + 1, 0)]
        near_i, near_j = np.nonzero(window)
        if not len(near_i):
            return None
        cells = (near_i + first_i) * self.grid.shape[1] + near_j + first_j
        away = np.linalg.norm(self.grid.centres_m(cells) - point_m, axis=1)
        nearest = int(np.argmin(away))
        return int(cells[nearest]) if away[nearest] <= within_m else None

    def places_within(self, point_m: Float[ndarray, " 2"], radius_m: float) -> Int[ndarray, " n"]:
        """Indices into `places` of those at most so far from a point."""
        return np.flatnonzero(self._squared_distances(point_m) <= radius_m**2)

    def _squared_distances(self, point_m: Float[ndarray, " 2"]) -> Float[ndarray, " n_places"]:
        x, y = self._place_columns
        squared: Float[ndarray, " n_places"] = (x - point_m[0]) ** 2 + (y - point_m[1]) ** 2
        return squared

    @cached_property
    def _place_columns(self) -> tuple[Float[ndarray, " n_places"], Float[ndarray, " n_places"]]:
        return np.ascontiguousarray(self.places_m[:, 0]), np.ascontiguousarray(self.places_m[:, 1])

    @cached_property
    def _is_place(self) -> Bool[ndarray, "nx ny"]:
        is_place = np.zeros(self.grid.blocked.size, bool)
        is_place[self.places] = True
        return is_place.reshape(self.grid.shape)

    def distance_m(self, cell: int) -> float:
        """Path cost from the robot to a cell."""
        return float(self.reach.distance_m.ravel()[cell])
