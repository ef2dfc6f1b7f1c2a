"""Ways of a car over the navigation grid: kinodynamic A* in place of A* (HGS-Planner section IV-E).

Where a disc that turns on the spot needs a cell with room around it, a car needs room for its rectangle in a
heading that it can come to. `PoseReach` is everywhere it can get to, heading included; a way to one such pose
is hybrid A*'s, joined to its goal by Reeds-Shepp words and shortened by them (`native/hybrid_astar.cpp`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.native import kernels
from hgs_core.planning.navigation_grid import NavigationGrid
from hgs_core.planning.path_search import ENTRY_RADII_M
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.path import Path

PATH_STEP_M: Final = 0.05
"""Waypoints of a car's path are at most so far apart."""
_HEADINGS: Final = 24
_NOWHERE: Final = np.zeros((0, 3))


class KinodynamicConfig(StrictConfig):
    """How a car's ways are searched; other vehicles have no use for it."""

    margin_m: float = Field(0.02, ge=0)
    """Kept free around the rectangle of the body [m]: the controller's error and the map's."""
    reverse_factor: float = Field(2.0, ge=1)
    """A metre backwards costs as much as this many forwards: it is driven more slowly, and blind."""
    gear_change_m: float = Field(0.5, ge=0)
    """Changing between forwards and backwards costs as much as so many metres [m]."""
    steering_change_m: float = Field(0.1, ge=0)
    """So does turning the wheels from one side to the other [m]."""
    heuristic_weight: float = Field(1.3, ge=0)
    """Of what is left to go: 1 is exact up to the lattice, more finds a way sooner and a longer one."""
    most_states: int = Field(60_000, ge=1)
    """A search gives up after so many states."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseReach:
    """Every (cell, heading) that the car can get to from where it stands."""

    cost_m: Float32[ndarray, "nx ny n_headings"]
    """Of driving there [m], backwards and changes of gear counted as configured; +inf: it cannot."""

    @property
    def anyhow(self) -> Bool[ndarray, "nx ny"]:
        """Cells that it can get to in some heading."""
        reached: Bool[ndarray, "nx ny"] = np.isfinite(self.cost_m).any(axis=2)
        return reached

    def costs_at(
        self, cells: Int[ndarray, " n"], yaws_rad: Float[ndarray, " n_yaws"]
    ) -> Float[ndarray, "n n_yaws"]:
        """Of flat cells in each of some yaws; a heading to either side counts as well."""
        by_cell = self.cost_m.reshape(-1, _HEADINGS)[cells]
        near = np.minimum(by_cell, np.minimum(np.roll(by_cell, 1, axis=1), np.roll(by_cell, -1, axis=1)))
        costs: Float[ndarray, "n n_yaws"] = near[:, _heading_of(yaws_rad)].astype(np.float64)
        return costs


class CarWays:
    """The car on one state of the grid, standing at one pose."""

    def __init__(
        self,
        grid: NavigationGrid,
        car: AckermannConfig,
        config: KinodynamicConfig,
        standing: Float[ndarray, " 3"],
    ) -> None:
        self._grid = grid
        self._config = config
        self._radius_m = car.planned_radius_m
        self._body_m = body_of(car, config.margin_m)
        self._costs = np.array(
            [
                config.reverse_factor,
                config.gear_change_m / grid.size_m,
                config.steering_change_m / grid.size_m,
            ]
        )
        self._standing_m = standing
        self._standing = self._in_cells(standing[None])
        inside = grid.clearance_m >= min(car.rear_overhang_m, car.width_m / 2)
        self._cost = np.where(inside, grid.soft_cost, np.float32(np.inf)).astype(np.float32)
        self.reach = PoseReach(
            cost_m=kernels.car_reach(
                self._blocked,
                grid.clearance_cells,
                self._body_m / grid.size_m,
                self._radius_m / grid.size_m,
                self._costs,
                self._standing,
                _HEADINGS,
            )
            * np.float32(grid.size_m)
        )

    def entries(self) -> tuple[Int[ndarray, " n"], Float[ndarray, " n"]]:
        """Cells around the car that it can get to and a disc has room in, and what they cost it [m].

        All of them, not only the nearest: it may stand where no disc has room, beside a pocket of cells that
        a disc could not leave.
        """
        passable = self._grid.passable & self.reach.anyhow
        cells = self._grid.cells_within(passable, self._standing_m[:2], ENTRY_RADII_M[-1])
        return cells, self.reach.cost_m.reshape(-1, _HEADINGS)[cells].min(axis=1).astype(np.float64)

    def may_stand(
        self, cells: Int[ndarray, " n"], places_m: Float[ndarray, "n 2"], yaws_rad: Float[ndarray, " n_yaws"]
    ) -> Bool[ndarray, "n n_yaws"]:
        """In which yaws the car fits at places (in `cells`), and can get to."""
        poses = np.column_stack(
            [np.repeat(places_m, len(yaws_rad), axis=0), np.tile(yaws_rad, len(places_m))]
        )
        free = self.poses_free(poses).reshape(len(places_m), len(yaws_rad))
        return free & np.isfinite(self.reach.costs_at(cells, yaws_rad))

    def poses_free(self, poses: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """At which poses (x [m], y [m], yaw [rad]) the rectangle and its margin meet nothing blocked."""
        return poses_free(self._grid, self._body_m, poses, standing=_NOWHERE)

    def way(
        self,
        start: Float[ndarray, " 3"],
        place_m: Float[ndarray, " 2"],
        yaws_rad: Float[ndarray, " n_yaws"],
    ) -> Path | None:
        """The way from a pose to a place, to be reached in any of some yaws: the cheapest. `None`: none was
        found. The path's only yaw is the last one."""
        goals = np.column_stack([np.tile(place_m, (len(yaws_rad), 1)), yaws_rad])
        table, _, _ = kernels.hybrid_astar(
            self._blocked,
            self._grid.clearance_cells,
            self._grid.soft_cost,
            self._cost,
            self._body_m / self._grid.size_m,
            self._radius_m / self._grid.size_m,
            self._costs,
            self._in_cells(start[None]),
            self._in_cells(goals),
            self._config.heuristic_weight,
            self._config.most_states,
            PATH_STEP_M / self._grid.size_m,
        )
        if not len(table):
            return None
        yaws = np.full(len(table), np.nan)
        yaws[-1] = table[-1, 2]
        return Path(
            positions_m=table[:, :2] * self._grid.size_m + self._grid.lower_m,
            yaws_rad=yaws,
            headings_rad=table[:, 2].copy(),
        )

    def way_any_heading(self, place_m: Float[ndarray, " 2"]) -> Path | None:
        """The way from where the car stands to a place, whatever its heading there; it has no yaw."""
        yaws = np.arange(_HEADINGS // 2) * (4 * np.pi / _HEADINGS)
        way = self.way(self._standing_m, place_m, yaws)
        return None if way is None else replace(way, yaws_rad=np.full(len(way.yaws_rad), np.nan))

    def lengths_m(self, poses: Float[ndarray, "n 3"]) -> Float[ndarray, "n n"]:
        """Of the shortest ways between every two poses if nothing were in the way [m]."""
        return kernels.reeds_shepp_lengths(poses, poses, self._radius_m)

    @property
    def _blocked(self) -> ndarray:
        return self._grid.blocked.view(np.uint8)

    def _in_cells(self, poses: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        return in_cells(self._grid, poses)


def body_of(car: AckermannConfig, margin_m: float) -> Float[ndarray, " 3"]:
    """Rear, front and half width of the rectangle, a margin around it included [m]."""
    return np.array([car.rear_overhang_m, car.front_m, car.width_m / 2]) + margin_m


def body_points(car: AckermannConfig, poses: Float[ndarray, "n 3"]) -> Float[ndarray, "m 2"]:
    """Points of the body at each pose, at most 5 cm apart, its edges' among them."""
    rear, front, half = body_of(car, 0.0)
    ahead = np.linspace(-rear, front, 1 + int(np.ceil((rear + front) / 0.05)))
    beside = np.linspace(-half, half, 1 + int(np.ceil(2 * half / 0.05)))
    u, v = (axis.ravel() for axis in np.meshgrid(ahead, beside))
    cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    points = np.stack([poses[:, :1] + u * cos - v * sin, poses[:, 1:2] + u * sin + v * cos], axis=-1)
    return points.reshape(-1, 2)


def in_cells(grid: NavigationGrid, poses: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Poses in the grid's cells and radians."""
    return np.ascontiguousarray(
        np.column_stack([(poses[:, :2] - grid.lower_m) / grid.size_m, poses[:, 2]]), dtype=np.float64
    )


def poses_free(
    grid: NavigationGrid,
    body_m: Float[ndarray, " 3"],
    poses: Float[ndarray, "n 3"],
    *,
    standing: Float[ndarray, "n_standing 3"],
) -> Bool[ndarray, " n"]:
    """At which poses a rectangle meets nothing blocked; what it meets where it stands is forgiven, as long as
    it gets no deeper into it."""
    return kernels.car_poses_free(
        grid.blocked.view(np.uint8),
        grid.clearance_cells,
        body_m / grid.size_m,
        in_cells(grid, poses),
        in_cells(grid, standing),
    )


def _heading_of(yaws_rad: Float[ndarray, " n"]) -> Int[ndarray, " n"]:
    headings: Int[ndarray, " n"] = np.rint(yaws_rad * _HEADINGS / (2 * np.pi)).astype(np.int64) % _HEADINGS
    return headings
