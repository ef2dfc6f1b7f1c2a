"""What an operator's directives mean for a mission under way: what changes, and what cannot be kept."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.planning.directives import Directives
from hgs_core.planning.navigator import Navigator
from hgs_core.robot.robot import RobotState


def asks_for_another_plan(before: Directives, after: Directives) -> bool:
    """Whether the plan under way may not be what is asked for any more."""
    return any(
        getattr(before, name) != getattr(after, name)
        for name in ("region", "no_go", "max_path_m", "return_to_start")
    )


def what_cannot_be_kept(
    directives: Directives,
    robot: RobotState,
    start_m: Float[ndarray, " 2"],
    navigator: Navigator,
) -> list[str]:
    """Sentences for the operator; `navigator` obeys the directives already."""
    found = []
    if navigator.stands_in_no_go(robot.x_m, robot.y_m):
        found.append("the robot stands in a no-go area: it leaves by the shortest way")
    if directives.return_to_start and navigator.stands_in_no_go(*np.asarray(start_m).tolist()):
        found.append("the start lies in a no-go area: the robot cannot return to it")
    if directives.max_path_m is not None and robot.path_length_m >= directives.max_path_m:
        then = "it drives back to its start, farther than that" if directives.return_to_start else "it ends"
        found.append(
            f"the robot has driven {robot.path_length_m:.1f} m already, and is to drive no more than "
            f"{directives.max_path_m:.1f} m: {then}"
        )
    return found
