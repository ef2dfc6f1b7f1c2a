"""What an operator's directives mean for a mission under way, and its plans held against them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from hgs_core.mapping.mapper import Mapper
from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import AT_GOAL_M, Navigator
from hgs_core.planning.path_budget import with_reserve
from hgs_core.planning.plan import Plan, Planner, on_floor
from hgs_core.robot.path import Path
from hgs_core.robot.robot import Robot


def asks_for_another_plan(before: Directives, after: Directives) -> bool:
    """Whether the plan under way may not be what is asked for any more."""
    return any(
        getattr(before, name) != getattr(after, name)
        for name in ("region", "no_go", "max_path_m", "return_to_start")
    )


class Bounds:
    """What is asked of a mission now, and every plan held against it."""

    def __init__(
        self, directives: Directives, *, robot: Robot, mapper: Mapper, planner: Planner, navigator: Navigator
    ) -> None:
        self.directives = directives
        self.start_m = np.array([robot.state.x_m, robot.state.y_m])
        """Where the mission began."""
        self._robot = robot
        self._mapper = mapper
        self._planner = planner
        self._navigator = navigator

    def keep_to(self, directives: Directives) -> None:
        """Let planner and navigator obey these from now on."""
        self.directives = directives
        self._planner.obey(directives, self.start_m)
        self._navigator.obey(directives)

    def what_cannot_be_kept(self) -> list[str]:
        """Sentences for the operator."""
        directives, robot = self.directives, self._robot.state
        found = []
        if self._navigator.stands_in_no_go(robot.x_m, robot.y_m):
            found.append("the robot stands in a no-go area: it leaves by the shortest way")
        if directives.return_to_start and self._navigator.stands_in_no_go(*self.start_m.tolist()):
            found.append("the start lies in a no-go area: the robot cannot return to it")
        if directives.max_path_m is not None and robot.path_length_m >= directives.max_path_m:
            then = (
                "it drives back to its start, farther than that" if directives.return_to_start else "it ends"
            )
            found.append(
                f"the robot has driven {robot.path_length_m:.1f} m already, and is to drive no more than "
                f"{directives.max_path_m:.1f} m: {then}"
            )
        return found

    @property
    def left_m(self) -> float:
        """What is left of the path budget; +inf without one."""
        budget_m = self.directives.max_path_m
        return np.inf if budget_m is None else budget_m - self._robot.state.path_length_m

    @property
    def is_back(self) -> bool:
        """Whether the robot is where the mission began."""
        state = self._robot.state
        return bool(np.hypot(*(self.start_m - (state.x_m, state.y_m))) <= AT_GOAL_M)

    def enters_no_go(self, plan: Plan) -> bool:
        """Whether the way to the first view does: no planner is taken at its word."""
        return self._navigator.enters_no_go(plan.path.to_first_view())

    def within(self, plan: Plan) -> Plan | None:
        """The plan, held against the path budget: a way that is longer is replaced by the shortest;
        None where that is too long, too."""
        leg = plan.path.to_first_view()
        left_m = self.left_m
        if not np.isfinite(left_m) or not len(leg.positions_m):
            return plan
        snapshot, state, goal_m = self._mapper.snapshot(), self._robot.state, leg.positions_m[-1]
        if self.directives.return_to_start:
            back_m = self._navigator.length_m(snapshot, state, goal_m, self.start_m)
            left_m -= float(with_reserve(np.array([back_m]))[0])
        if leg.length_m <= left_m:
            return plan
        way = self._navigator.way_to(snapshot, state, goal_m, left_m)
        return None if way is None or way.length_m > left_m else self.redirected(plan, way, leg.yaws_rad[-1])

    def redirected(self, plan: Plan, way: Path, yaw_rad: float) -> Plan:
        """The plan with another way to another first view, which the planner is told of."""
        yaws = way.yaws_rad.copy()
        yaws[-1] = yaw_rad if way.headings_rad is None else way.headings_rad[-1]
        path = replace(way, yaws_rad=yaws)
        redirected = replace(plan, path=path, local_path_m=on_floor(path.positions_m))
        self._planner.adopt(self._mapper.snapshot(), self._robot.state, redirected)
        return redirected

    def state(self) -> dict[str, Any]:
        return {"directives": self.directives.model_dump(mode="json"), "start_m": self.start_m.copy()}

    def restore(self, state: dict[str, Any]) -> None:
        """To be called before the planner is restored, which is told what it obeys."""
        self.start_m = np.array(state["start_m"])
        self.keep_to(Directives.model_validate(state["directives"]))
