"""How long a robot takes between views: driving along the grid's ways, and turning.

A differential robot turns on the spot, before and after it drives; a holonomic one while it drives. A car
drives at least the grid's way and at least what it would have to without obstacles to come to the view's
heading (Reeds and Shepp); from where it stands, what it takes to get there is known."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.planning.car_ways import CarWays
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.path_search import pairwise_costs
from hgs_core.planning.views import View, turn_rad
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.robot import RobotConfig


class TravelTimes:
    """Seconds at the robot's speeds: from the heading at the start turned to the drive's, and from there to
    the view's. `turning_weight` makes turning count for less, where it is the metres that matter."""

    def __init__(self, robot: RobotConfig, *, turning_weight: float = 1.0) -> None:
        self._robot = robot
        self._speed_mps = robot.max_speed_mps
        turns = (
            robot.max_turn_rate_degps if isinstance(robot, DifferentialConfig | HolonomicConfig) else np.inf
        )
        self._turn_rate_radps = np.radians(turns)
        self._turning_weight = turning_weight

    def committed_times_s(
        self,
        cycle: PlanningCycle,
        stops: list[View],
        next_m: Float[ndarray, " 2"] | None,
        commitment_s: float,
    ) -> Float[ndarray, "n n"]:
        """`times_s`, but the place that was to come next is `commitment_s` nearer to the robot."""
        costs = self.times_s(cycle, stops)
        if next_m is not None:
            for k, view in enumerate(stops):
                if np.hypot(*(view.xy_m - next_m)) <= cycle.grid.size_m:
                    costs[0, k + 1] = max(0.0, costs[0, k + 1] - commitment_s)
        return costs

    @staticmethod
    def driving_m(cycle: PlanningCycle, stops: list[View]) -> Float[ndarray, " n"]:
        """The way from the robot to each of the stops, as the grid counts it."""
        robot = cycle.robot_xy_m
        metres = [0.0 if np.all(view.xy_m == robot) else cycle.distance_m(view.cell) for view in stops]
        return np.array(metres, dtype=np.float64)

    def times_s(self, cycle: PlanningCycle, stops: list[View]) -> Float[ndarray, "n n"]:
        """Seconds between every two of the robot's pose (row 0) and the stops."""
        robot = cycle.robot_xy_m
        at_robot = np.array([bool(np.all(view.xy_m == robot)) for view in stops])
        away = self.driving_m(cycle, stops)
        n = len(stops)
        drive = np.zeros((n + 1, n + 1))
        drive[0, 1:] = drive[1:, 0] = away
        placed = np.flatnonzero(~at_robot)
        drive[np.ix_(placed + 1, placed + 1)] = pairwise_costs(
            cycle.grid, np.array([stops[k].cell for k in placed], dtype=np.int64)
        )
        for k in np.flatnonzero(at_robot):
            drive[k + 1, 1:] = drive[1:, k + 1] = away
        drive = np.minimum(drive, _by_way_of_robot(away))
        places = np.stack([robot, *(view.xy_m for view in stops)])
        yaws = [cycle.robot.yaw_rad, *(view.yaw_rad for view in stops)]
        if cycle.car is not None:
            return _by_car(cycle, cycle.car, stops, drive) / self._speed_mps
        times = drive / self._speed_mps
        if isinstance(self._robot, HolonomicConfig):
            turned = np.abs(np.subtract.outer(yaws, yaws))
            turning = np.minimum(turned, 2 * np.pi - turned) / self._turn_rate_radps
            return np.maximum(times, self._turning_weight * turning)
        for a in range(n + 1):
            for b in range(1, n + 1):
                times[a, b] += self._turning_weight * self._turning_s(places[a], yaws[a], places[b], yaws[b])
        return times

    def _turning_s(
        self, start: Float[ndarray, " 2"], yaw_start: float, end: Float[ndarray, " 2"], yaw_end: float
    ) -> float:
        dx, dy = end - start
        if np.hypot(dx, dy) < 0.05:
            return turn_rad(yaw_start, yaw_end) / self._turn_rate_radps
        bearing = float(np.arctan2(dy, dx))
        return (turn_rad(yaw_start, bearing) + turn_rad(bearing, yaw_end)) / self._turn_rate_radps


def _by_car(
    cycle: PlanningCycle, car: CarWays, stops: list[View], drive_m: Float[ndarray, "m m"]
) -> Float[ndarray, "m m"]:
    """Metres that a car drives at least, of the robot's pose (row 0) and the stops."""
    poses = np.array([cycle.robot_pose, *([*view.xy_m, view.yaw_rad] for view in stops)])
    metres = np.maximum(drive_m, car.lengths_m(poses))
    for k, view in enumerate(stops):
        known = car.reach.costs_at(np.array([view.cell]), np.array([view.yaw_rad]))[0, 0]
        if np.isfinite(known):
            metres[0, k + 1] = max(metres[0, k + 1], known)
    np.fill_diagonal(metres, 0.0)
    return metres


def _by_way_of_robot(away: Float[ndarray, " n"]) -> Float[ndarray, "m m"]:
    """Costs by way of the robot's place, which joins everything that is reachable."""
    from_robot = np.concatenate([[0.0], away])
    sums: Float[ndarray, "m m"] = from_robot[:, None] + from_robot[None, :]
    np.fill_diagonal(sums, 0.0)
    return sums
