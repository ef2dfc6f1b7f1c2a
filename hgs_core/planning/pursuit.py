"""The plan under way: which of its views were taken, which are ahead, whether its path is still clear."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.car_ways import body_of, poses_free
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.low_obstacles import TouchMemory
from hgs_core.planning.navigation_grid import NavigationGrid, build_navigation_grid
from hgs_core.planning.views import turn_rad
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState

TAKEN_WITHIN_M = 0.1
TAKEN_WITHIN_RAD = np.radians(10.0)
CLEARANCE_TOLERANCE_M = 0.005
"""A path sampled from elsewhere along it measures slightly different clearances."""


class Pursuit:
    """Remembers the last plan's path between cycles."""

    def __init__(self, config: PlannerConfig, robot: RobotConfig, touches: TouchMemory) -> None:
        self._touches = touches
        self._config = config
        self._robot = robot
        self._views: Float[ndarray, "n_views 4"] = np.zeros((0, 4))
        """x [m], y [m], yaw [rad] and predicted gain of the views on the path, in order."""
        self._accepted_m: Float[ndarray, " n_segments"] = np.zeros(0)
        """Clearance that each segment of the path had when it was planned."""
        self._checked_s = -np.inf

    def follow(
        self, path: Path, gains: Float[ndarray, " n_views"], grid: NavigationGrid, timestamp_s: float
    ) -> None:
        """A new plan is under way; `gains` are the evaluator's for each view on its path."""
        at = np.isfinite(path.yaws_rad)
        self._views = np.column_stack([path.positions_m[at], path.yaws_rad[at], gains])
        self._accepted_m = grid.path_clearance_m(path.positions_m)
        self._checked_s = timestamp_s

    def drop(self) -> None:
        """No plan is under way."""
        self._views = np.zeros((0, 4))
        self._accepted_m = np.zeros(0)

    def views_taken_at(self, robot: RobotState) -> Float[ndarray, "n 4"]:
        """The next views of the path that the robot's pose has just taken; they are no longer ahead."""
        n = 0
        for x_m, y_m, yaw_rad, _ in self._views:
            near = np.hypot(x_m - robot.x_m, y_m - robot.y_m) <= TAKEN_WITHIN_M
            if not near or turn_rad(robot.yaw_rad, yaw_rad) > TAKEN_WITHIN_RAD:
                break
            n += 1
        taken, self._views = self._views[:n], self._views[n:]
        return taken

    def views_ahead_m(self) -> Float[ndarray, "n 2"]:
        """Places of the views not yet taken, the next one first."""
        return self._views[:, :2]

    def recheck_due(self, timestamp_s: float) -> bool:
        """True every `recheck_interval_s` of mission time."""
        if timestamp_s - self._checked_s < self._config.recheck_interval_s:
            return False
        self._checked_s = timestamp_s
        return True

    def why_blocked(
        self,
        snapshot: MapSnapshot,
        robot: RobotState,
        path: Path,
        waypoints_passed: int,
        *,
        forbidden: Bool[ndarray, "nx ny"] | None = None,
    ) -> str | None:
        """Check the path as far as its next view on the newest map, rebuilding only the part around it.

        Every view brings a new plan, and what lies behind it is checked once it is passed: so a blocked path
        is always reported before it is driven, and far-off flicker stops nobody. A segment is blocked when it
        has less than the robot's radius of clearance and less than it had when it was planned (a path out of
        a tight place is tight from the start).
        """
        if waypoints_passed >= len(path.positions_m):
            return None
        here = np.array([robot.x_m, robot.y_m])
        views = np.flatnonzero(np.isfinite(path.yaws_rad[waypoints_passed:]))
        end = waypoints_passed + int(views[0]) + 1 if len(views) else len(path.positions_m)
        ahead = np.concatenate([here[None], path.positions_m[waypoints_passed:end]])
        grid = build_navigation_grid(
            snapshot.voxels,
            self._config.navigation,
            self._robot,
            robot_xy_m=here,
            around_m=_with_body(ahead, self._robot),
            gaussians=snapshot.gaussians,
            touched_m=self._touches.points_m,
            forbidden=forbidden,
        )
        if path.headings_rad is not None:
            poses = np.column_stack([ahead[1:], path.headings_rad[waypoints_passed:end]])
            return self._why_car_blocked(grid, robot, poses)
        clearance = grid.path_clearance_m(ahead)
        required = np.full(len(clearance), self._robot.radius_m)
        if len(self._accepted_m) == max(len(path.positions_m) - 1, 1):
            segments = np.clip(np.arange(len(clearance)) + waypoints_passed - 1, 0, len(self._accepted_m) - 1)
            required = np.minimum(required, self._accepted_m[segments])
        short = np.flatnonzero(clearance < required - CLEARANCE_TOLERANCE_M)
        if not len(short):
            return None
        away = float(np.linalg.norm(np.diff(ahead[: short[0] + 1], axis=0), axis=1).sum())
        return f"blocked: {clearance[short[0]]:.2f} m of clearance on the path, {away:.1f} m ahead or less"

    def _why_car_blocked(
        self, grid: NavigationGrid, robot: RobotState, poses: Float[ndarray, "n 3"]
    ) -> str | None:
        """The body itself, without the margin that its way was planned with."""
        assert isinstance(self._robot, AckermannConfig)
        standing = np.array([[robot.x_m, robot.y_m, robot.yaw_rad]])
        free = poses_free(grid, body_of(self._robot, 0.0), poses, standing=standing)
        met = np.flatnonzero(~free)
        if not len(met):
            return None
        places = np.concatenate([standing[:, :2], poses[: met[0] + 1, :2]])
        away = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        return f"blocked: the body would meet something on the path, {away:.1f} m ahead"

    def state(self) -> dict[str, Any]:
        return {
            "views": self._views.copy(),
            "accepted_m": self._accepted_m.copy(),
            "checked_s": self._checked_s,
        }

    def restore(self, state: dict[str, Any]) -> None:
        self._views = np.array(state["views"])
        self._accepted_m = np.array(state["accepted_m"])
        self._checked_s = float(state["checked_s"])


def _with_body(places_m: Float[ndarray, "n 2"], robot: RobotConfig) -> Float[ndarray, "m 2"]:
    """The places, and for a car the corners of a square about them that holds its body in every heading."""
    if not isinstance(robot, AckermannConfig):
        return places_m
    reach = np.hypot(robot.front_m, robot.width_m / 2)
    return np.concatenate([places_m - reach, places_m + reach])
