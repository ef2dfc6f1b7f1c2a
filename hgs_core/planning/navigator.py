"""The mission's own ways: to where the operator points, out of a no-go area, back to the start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.car_ways import CarWays, body_points
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.directives import Directives
from hgs_core.planning.low_obstacles import TouchMemory
from hgs_core.planning.navigation_grid import NavigationGrid, build_navigation_grid
from hgs_core.planning.path_search import ENTRY_RADII_M, entries_within, path_from_robot, reach_from
from hgs_core.planning.pursuit import Pursuit
from hgs_core.planning.zones import TOLERANCE_M, Zones
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.voxels.voxel_map import VoxelMap

AT_GOAL_M: Final = 0.3
"""The robot is back at its start, or at a place that the operator chose, from this near."""


class Navigator:
    """Finds and watches ways that no planner asked for, over the same grid and within the same no-go areas.

    It keeps nothing between missions' steps but the areas, what the robot touched, and the way under way.
    """

    def __init__(self, config: PlannerConfig, robot: RobotConfig) -> None:
        self._config = config
        self._robot = robot
        self._touches = TouchMemory()
        self._pursuit = Pursuit(config, robot, self._touches)
        self._zones = Zones(Directives())

    def obey(self, directives: Directives) -> None:
        """Keep to these no-go areas from now on."""
        self._zones = Zones(directives)

    def stands_in_no_go(self, x_m: float, y_m: float) -> bool:
        """Whether any part of a robot that stands there is in a no-go area."""
        robot = self._robot
        radius_m = robot.width_m / 2 if isinstance(robot, AckermannConfig) else robot.radius_m
        nearest_m = self._zones.nearest_no_go_m(np.array([[x_m, y_m]]))
        return bool(nearest_m[0] < radius_m - TOLERANCE_M)

    def n_missing(self, voxels: VoxelMap) -> int:
        """How many voxels are missing where it is worth seeing."""
        inside = self._zones.inside(voxels)
        return voxels.n_missing if inside is None else int(voxels.missing_in_columns()[inside].sum())

    def enters_no_go(self, path: Path) -> bool:
        """Whether any part of a robot that drives along the path comes into a no-go area."""
        if path.headings_rad is not None and isinstance(self._robot, AckermannConfig):
            poses = np.column_stack([path.positions_m, path.headings_rad])
            return bool(np.any(self._zones.nearest_no_go_m(body_points(self._robot, poses)) <= 0.0))
        return self._zones.path_enters_no_go(path, self._robot.radius_m)

    def way_to(
        self,
        snapshot: MapSnapshot,
        robot: RobotState,
        goal_m: Float[ndarray, " 2"],
        longest_m: float = np.inf,
    ) -> Path | None:
        """The way to a point, as near as the robot can stand to it and no farther off than `AT_GOAL_M`: the
        best one, or the shortest where the best is longer than `longest_m`."""
        grid = self._grid(snapshot, robot, forbidden=self._zones.forbidden(snapshot.voxels))
        found = _best_or_shortest(grid, lambda on: _way_near(on, _place(robot), goal_m), longest_m)
        return None if found is None else self._along(grid, found, robot)

    def length_m(
        self,
        snapshot: MapSnapshot,
        robot: RobotState,
        from_m: Float[ndarray, " 2"],
        start_m: Float[ndarray, " 2"],
    ) -> float:
        """How long the best way back to the start is from a place; +inf where none is known."""
        grid = self._grid(snapshot, robot, forbidden=self._zones.forbidden(snapshot.voxels))
        way = _way_back(grid, from_m, start_m)
        return np.inf if way is None else _length_m(way)

    def way_back(
        self,
        snapshot: MapSnapshot,
        robot: RobotState,
        start_m: Float[ndarray, " 2"],
        longest_m: float = np.inf,
    ) -> Path | None:
        """The way to where the mission began, chosen likewise; None where none is known that ends within
        `AT_GOAL_M` of it."""
        grid = self._grid(snapshot, robot, forbidden=self._zones.forbidden(snapshot.voxels))
        to_start = _way_near if self.stands_in_no_go(*start_m.tolist()) else _way_back
        found = _best_or_shortest(grid, lambda on: to_start(on, _place(robot), start_m), longest_m)
        return None if found is None else self._along(grid, found, robot)

    def way_out(self, snapshot: MapSnapshot, robot: RobotState) -> Path | None:
        """The shortest way out of the no-go areas that the robot stands in."""
        allowed = self._grid(snapshot, robot, forbidden=self._zones.forbidden(snapshot.voxels))
        grid = _without_preferences(self._grid(snapshot, robot, forbidden=None))
        reach = reach_from(grid, _place(robot))
        outside = np.flatnonzero(reach.reachable & allowed.passable)
        if not len(outside):
            return None
        nearest = int(outside[np.argmin(reach.lengths_m(grid)[outside])])
        return self._along(grid, path_from_robot(grid, reach, nearest), robot, leaving=True)

    def why_blocked(
        self,
        snapshot: MapSnapshot,
        robot: RobotState,
        path: Path,
        waypoints_passed: int,
        *,
        leaving: bool,
    ) -> str | None:
        """Why the way under way cannot be driven on; `leaving` a no-go area, these do not block it."""
        forbidden = None if leaving else self._zones.forbidden(snapshot.voxels)
        return self._pursuit.why_blocked(snapshot, robot, path, waypoints_passed, forbidden=forbidden)

    def state(self) -> dict[str, Any]:
        """Plain data; the areas come from the directives in force."""
        return {"touches": self._touches.state(), "pursuit": self._pursuit.state()}

    def restore(self, state: dict[str, Any]) -> None:
        self._touches.restore(state["touches"])
        self._pursuit.restore(state["pursuit"])

    def _along(
        self,
        grid: NavigationGrid,
        points_m: Float[ndarray, "n 2"],
        robot: RobotState,
        *,
        leaving: bool = False,
    ) -> Path | None:
        """A way that is from now on under way; a car finds one of its own to the same end, or none. None,
        too, where it would brush a no-go area, which the grid's cells show to a fraction of a cell."""
        path: Path | None = Path(positions_m=points_m, yaws_rad=np.full(len(points_m), np.nan))
        if isinstance(self._robot, AckermannConfig):
            pose = np.array([robot.x_m, robot.y_m, robot.yaw_rad])
            path = CarWays(grid, self._robot, self._config.kinodynamic, pose).way_any_heading(points_m[-1])
        if path is None or (not leaving and self.enters_no_go(path)):
            return None
        self._pursuit.follow(path, np.zeros(0), grid, robot.timestamp_s)
        return path

    def _grid(
        self, snapshot: MapSnapshot, robot: RobotState, *, forbidden: Bool[ndarray, "nx ny"] | None
    ) -> NavigationGrid:
        self._touches.notice(robot, self._robot)
        return build_navigation_grid(
            snapshot.voxels,
            self._config.navigation,
            self._robot,
            robot_xy_m=_place(robot),
            gaussians=snapshot.gaussians,
            touched_m=self._touches.points_m,
            forbidden=forbidden,
        )


Points = Float[ndarray, "n 2"]


def _place(robot: RobotState) -> Float[ndarray, " 2"]:
    return np.array([robot.x_m, robot.y_m])


def _best_or_shortest(
    grid: NavigationGrid, find: Callable[[NavigationGrid], Points | None], longest_m: float
) -> Points | None:
    best = find(grid)
    if best is None or _length_m(best) <= longest_m:
        return best
    shortest = find(_without_preferences(grid))
    return best if shortest is None else min((best, shortest), key=_length_m)


def _way_near(
    grid: NavigationGrid, here_m: Float[ndarray, " 2"], goal_m: Float[ndarray, " 2"]
) -> Points | None:
    """The way to the reachable place nearest to a point."""
    reach = reach_from(grid, here_m)
    near: Int[ndarray, " n"] = grid.cells_within(reach.reachable, goal_m, AT_GOAL_M)
    if not len(near):
        return None
    off = np.linalg.norm(grid.centres_m(near) - goal_m, axis=1)
    return path_from_robot(grid, reach, int(near[np.argmin(off)]))


def _way_back(
    grid: NavigationGrid, here_m: Float[ndarray, " 2"], start_m: Float[ndarray, " 2"]
) -> Points | None:
    """The way that ends at the start itself, which may lie where the grid has no place."""
    reach = reach_from(grid, here_m)
    for radius_m in ENTRY_RADII_M:
        entries, costs = entries_within(grid, start_m, radius_m)
        costs = costs + reach.distance_m.ravel()[entries]
        if np.any(np.isfinite(costs)):
            way = path_from_robot(grid, reach, int(entries[np.argmin(costs)]))
            return np.concatenate([way, start_m[None]])
    return _way_near(grid, here_m, start_m)


def _without_preferences(grid: NavigationGrid) -> NavigationGrid:
    """The grid where every metre costs the same: its best ways are the shortest."""
    return replace(
        grid,
        soft_cost=np.ones_like(grid.soft_cost),
        cost=np.where(grid.passable, np.float32(1.0), np.float32(np.inf)),
    )


def _length_m(points_m: Float[ndarray, "n 2"]) -> float:
    return float(np.linalg.norm(np.diff(points_m, axis=0), axis=1).sum())
