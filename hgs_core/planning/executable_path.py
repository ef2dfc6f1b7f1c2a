"""From ordered views to the path that a robot drives: legs, waypoints, headings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.planning.car_ways import CarWays
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.path_search import path_from_robot, shortest_path
from hgs_core.planning.views import View
from hgs_core.robot.path import Path

SAME_PLACE_M = 1e-6
CAR_LEGS = 3
"""So many views a car's path leads to: each brings a new plan, and a leg takes milliseconds to find."""
CAR_TRIES = 4
"""So often a planner is asked again when a car finds a way to none of the views that it wants."""
NO_WAY = "a car finds no way to any view worth a stop"
CAR_YAWS_APART_RAD = np.radians(15.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Route:
    """A path and the views on it, in order."""

    path: Path
    views: list[View]


def car_route(cycle: PlanningCycle, car: CarWays, views: list[View]) -> Route:
    """The way of a car to the first of the views that it finds one to, and on to the next few.

    Without a view: no way was found to any.
    """
    pose = cycle.robot_pose
    legs: list[Path] = []
    driven: list[View] = []
    for view in views:
        way = car.way(pose, view.xy_m, view.good_yaws(CAR_YAWS_APART_RAD))
        if way is None and driven:
            break
        if way is None:
            continue
        legs.append(way)
        driven.append(view)
        pose = np.array([*way.positions_m[-1], way.yaws_rad[-1]])
        if len(driven) == CAR_LEGS:
            break
    return Route(path=_joined(legs), views=driven)


def _joined(legs: list[Path]) -> Path:
    if not legs:
        return Path.empty()
    parts = [legs[0], *(leg.without_first() for leg in legs[1:])]
    return Path(
        positions_m=np.concatenate([part.positions_m for part in parts]),
        yaws_rad=np.concatenate([part.yaws_rad for part in parts]),
        headings_rad=np.concatenate([part.headings_rad for part in parts if part.headings_rad is not None]),
    )


def join_views(cycle: PlanningCycle, views: list[View]) -> Path:
    """The path from the robot through all views, each with the yaw that needs least turning on arrival."""
    positions = [cycle.robot_xy_m]
    yaws = [np.nan]
    heading = cycle.robot.yaw_rad
    before: View | None = None
    for view in views:
        for point in leg_between(cycle, before, view)[1:]:
            step = point - positions[-1]
            if np.hypot(*step) > SAME_PLACE_M:
                heading = float(np.arctan2(step[1], step[0]))
                positions.append(point)
                yaws.append(np.nan)
        heading = view.yaw_near(heading)
        if np.isfinite(yaws[-1]):  # a second view from the same place
            positions.append(positions[-1])
            yaws.append(np.nan)
        yaws[-1] = heading
        before = view
    return Path(positions_m=np.stack(positions), yaws_rad=np.array(yaws))


def leg_between(cycle: PlanningCycle, before: View | None, goal: View) -> Float[ndarray, "n 2"]:
    """The grid's way to `goal` from `before` (`None`: from the robot), both reachable."""
    grid, reach = cycle.grid, cycle.reach
    if before is None or _at_robot(cycle, before):
        return _from_robot(cycle, goal)
    if _at_robot(cycle, goal):
        return path_from_robot(grid, reach, before.cell)[::-1]
    direct = shortest_path(grid, before.cell, goal.cell)
    if direct is not None:
        return direct
    # The robot's own place joins what the grid keeps apart (it may stand where it could not pass): back,
    # then on.
    return np.concatenate([path_from_robot(grid, reach, before.cell)[::-1], _from_robot(cycle, goal)[1:]])


def _from_robot(cycle: PlanningCycle, goal: View) -> Float[ndarray, "n 2"]:
    if _at_robot(cycle, goal):
        return cycle.robot_xy_m[None]
    return path_from_robot(cycle.grid, cycle.reach, goal.cell)


def _at_robot(cycle: PlanningCycle, view: View) -> bool:
    return bool(np.all(view.xy_m == cycle.robot_xy_m))


def first_exit(polyline_m: Float[ndarray, "n 2"], cycle: PlanningCycle) -> Float[ndarray, " 2"] | None:
    """Where a polyline that begins in the horizon first leaves it; `None` if it stays inside."""
    lower, upper = cycle.horizon.lower_m[:2], cycle.horizon.upper_m[:2]
    inside = np.all((polyline_m >= lower) & (polyline_m <= upper), axis=1)
    outside = np.flatnonzero(~inside)
    if not len(outside) or outside[0] == 0:
        return None
    a, b = polyline_m[outside[0] - 1], polyline_m[outside[0]]
    step = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        to_border = np.where(step > 0, (upper - a) / step, np.where(step < 0, (lower - a) / step, np.inf))
    crossing: Float[ndarray, " 2"] = a + float(np.clip(to_border.min(), 0.0, 1.0)) * step
    return crossing
