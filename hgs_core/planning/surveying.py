"""What planners around a `Survey` share beyond planning: the operator's wishes, and what is unseen."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.directives import Directives
from hgs_core.planning.plan import Insight, Plan, UnseenRegion
from hgs_core.planning.survey import Survey
from hgs_core.robot.robot import RobotState


class SurveyingPlanner:
    """The part of a `Planner` that its survey answers for."""

    def __init__(self, survey: Survey) -> None:
        self._survey = survey

    def obey(self, directives: Directives, start_xy_m: Float[ndarray, " 2"]) -> None:
        """See `Planner`."""
        self._survey.obey(directives, start_xy_m)
        self._reconsider()

    def refuse(self, snapshot: MapSnapshot, x_m: float, y_m: float, yaw_rad: float) -> None:
        """See `Planner`."""
        self._survey.refuse(snapshot, x_m, y_m, yaw_rad)
        self._reconsider()

    def adopt(self, snapshot: MapSnapshot, robot: RobotState, plan: Plan) -> None:
        """See `Planner`."""
        self._survey.adopt(snapshot, robot, plan)

    def unseen(self, snapshot: MapSnapshot, robot: RobotState) -> tuple[UnseenRegion, ...]:
        """What is unseen now. Regions that were still to be visited have the reason `INTERRUPTED`."""
        if not snapshot.voxels.states.size:
            return ()
        return self._survey.unseen(self._survey.cycle(snapshot, robot))

    def insight(self, snapshot: MapSnapshot, plan: Plan | None) -> Insight:
        """See `Insightful`."""
        view_m, panorama = None, None
        if plan is not None:
            at = np.flatnonzero(np.isfinite(plan.path.yaws_rad))
            if len(at):
                view_m = np.append(plan.path.positions_m[at[0]], self._survey.context.camera_height_m)
                panorama = self._survey.panorama(snapshot, view_m)
        return Insight(view_m=view_m, panorama=panorama, roadmap_m=self._roadmap_m())

    def _roadmap_m(self) -> Float[ndarray, "n_edges 2 2"]:
        return np.zeros((0, 2, 2))

    def _reconsider(self) -> None:
        """Forget what was concluded under other wishes."""
