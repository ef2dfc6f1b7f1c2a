"""What one planning cycle knows: gathered once, read by the global and the local level."""

from __future__ import annotations

from dataclasses import dataclass

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

    def nearest_place(self, point_m: Float[ndarray, " 2"]) -> tuple[int, float]:
        """The place nearest to a point and its distance [m]; there must be one."""
        away = np.linalg.norm(self.places_m - point_m, axis=1)
        nearest = int(np.argmin(away))
        return int(self.places[nearest]), float(away[nearest])

    def place_near(self, point_m: Float[ndarray, " 2"], within_m: float) -> int | None:
        """The place nearest to a point, if it is near enough."""
        if not len(self.places):
            return None
        cell, away = self.nearest_place(point_m)
        return cell if away <= within_m else None

    def distance_m(self, cell: int) -> float:
        """Path cost from the robot to a cell."""
        return float(self.reach.distance_m.ravel()[cell])
