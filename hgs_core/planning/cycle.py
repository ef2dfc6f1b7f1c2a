"""What one planning cycle knows: gathered once, read by the global and the local level."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from hgs_core.gain.viewpoint import SurfaceInView
from hgs_core.geometry.boxes import Box
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.native import kernels
from hgs_core.planning.car_ways import CarWays
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import ReachField
from hgs_core.planning.subspaces import MissingColumns, SubspacePartition
from hgs_core.planning.views import View, ViewScorer
from hgs_core.robot.robot import RobotState


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningCycle:
    """The world as one call of `plan()` sees it."""

    snapshot: MapSnapshot
    """Where only the region of interest is worth seeing, if there is one: what views are scored on."""
    whole: MapSnapshot
    """The maps as they are."""
    robot: RobotState
    grid: NavigationGrid
    reach: ReachField
    is_place: Bool[ndarray, "nx ny"]
    """Cells where a viewpoint may be: reachable, within the map's bounds, the operator's region and what is
    left of the path budget."""
    too_far: Bool[ndarray, "nx ny"] | None
    """Cells that are no places for want of path budget alone; None without a budget."""
    horizon: Box
    missing: MissingColumns
    partition: SubspacePartition
    observed_share: float
    preferred_clearance_m: float
    scorer: ViewScorer
    car: CarWays | None = None
    """Where the robot is a car: how it gets about."""

    @property
    def robot_xy_m(self) -> Float[ndarray, " 2"]:
        return np.array([self.robot.x_m, self.robot.y_m])

    @property
    def robot_pose(self) -> Float[ndarray, " 3"]:
        """x [m], y [m], yaw [rad]."""
        return np.array([self.robot.x_m, self.robot.y_m, self.robot.yaw_rad])

    def score(self, cells: Int[ndarray, " n"], *, coverage_only: bool = False) -> list[View]:
        """Views at cell centres; see `GainEvaluator.evaluate`."""
        return self.scorer.score(
            self.snapshot,
            self.grid.centres_m(cells),
            [int(c) for c in cells],
            self.observed_share,
            coverage_only=coverage_only,
        )

    def new_surface_in_view(self, views: list[View]) -> list[SurfaceInView]:
        """Where each view, at its best yaw, would see new surface."""
        return self.scorer.new_surface_in_view(self.snapshot, views)

    def score_here(self) -> list[View]:
        """The view from the robot's own place, to be had by turning alone; none where it may not stand."""
        cell = self.place_near(self.robot_xy_m, 4.0 * self.grid.size_m)
        if cell is None:
            return []
        return self.scorer.score(self.snapshot, self.robot_xy_m[None], [cell], self.observed_share)

    def in_horizon(self, points_m: Float[ndarray, "n 2"]) -> Bool[ndarray, " n"]:
        inside: Bool[ndarray, " n"] = np.all(
            (points_m >= self.horizon.lower_m[:2]) & (points_m < self.horizon.upper_m[:2]), axis=1
        )
        return inside

    def nearest_place(self, point_m: Float[ndarray, " 2"]) -> int:
        """The place nearest to a point; there must be one."""
        within_m = 0.5
        while (place := self.place_near(point_m, within_m)) is None:
            within_m *= 2.0
        return place

    def place_near(self, point_m: Float[ndarray, " 2"], within_m: float) -> int | None:
        """The place nearest to a point, if it is near enough."""
        (own,), (inside,) = self.grid.cells_of(point_m[None])
        if inside and within_m >= self.grid.size_m and self.is_place.ravel()[own]:
            return int(own)  # no other centre is nearer
        cells = self.grid.cells_within(self.is_place, point_m, within_m)
        if not len(cells):
            return None
        away = self.grid.centres_m(cells) - point_m
        return int(cells[np.argmin(away[:, 0] ** 2 + away[:, 1] ** 2)])

    def places_within(self, point_m: Float[ndarray, " 2"], radius_m: float) -> Int[ndarray, " n"]:
        """Places (flat cells) at most so far from a point."""
        return self.grid.cells_within(self.is_place, point_m, radius_m)

    def count_places_within(self, points_m: Float[ndarray, "n 2"], radius_m: float) -> Int[ndarray, " n"]:
        """How many places are at most so far from each point."""
        counts = kernels.grid_count_in_discs(
            self.is_place.view(np.uint8),
            np.ascontiguousarray((points_m - self.grid.lower_m) / self.grid.size_m, np.float64),
            radius_m / self.grid.size_m,
        )
        return counts.astype(np.int64)

    def places_in_horizon(self) -> Int[ndarray, " n"]:
        """Places (flat cells) inside the horizon."""
        cells = self.grid.cells_between(self.is_place, self.horizon.lower_m[:2], self.horizon.upper_m[:2])
        return cells[self.in_horizon(self.grid.centres_m(cells))]

    def places_apart(self, wanted_m: Iterable[Float[ndarray, " 2"]], apart_m: float) -> Int[ndarray, " n"]:
        """The places (flat cells) inside the horizon at wanted points, earlier ones first.

        What is nearer than `apart_m` to the robot or to one before it is left out.
        """
        kept: list[int] = []
        for point in wanted_m:
            cell = self.place_near(point, self.grid.size_m)
            if cell is None or not self.in_horizon(point[None])[0]:
                continue
            away = self.taken_m(np.array(kept, np.int64)) - self.grid.centres_m(np.array([cell]))
            if np.min(np.linalg.norm(away, axis=1)) >= apart_m:
                kept.append(cell)
        return np.array(kept, dtype=np.int64)

    def taken_m(self, cells: Int[ndarray, " n"]) -> Float[ndarray, "m 2"]:
        """The robot's position and the cells' centres: what further samples keep away from."""
        return np.concatenate([self.robot_xy_m[None], self.grid.centres_m(cells)])

    def is_roomy(self, cells: Int[ndarray, " n"]) -> Bool[ndarray, " n"]:
        """Which cells have the preferred clearance."""
        roomy: Bool[ndarray, " n"] = self.grid.clearance_m.ravel()[cells] >= self.preferred_clearance_m
        return roomy

    def distance_m(self, cell: int) -> float:
        """Path cost from the robot to a cell."""
        return float(self.reach.distance_m.ravel()[cell])
