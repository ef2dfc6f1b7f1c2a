"""Planning cycles with made-up views, to try policies by hand."""

from __future__ import annotations

import numpy as np

from hgs_core.gain.viewpoint import GainEvaluator, ViewGains
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.cycle import PlanningCycle
from hgs_core.planning.next_best_view import NextBestViewConfig
from hgs_core.planning.survey import Survey
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelMap
from tests.planning.closed_loop import context_in
from tests.planning.closed_world import ClosedWorld, PointRobot


class GainByPlace:
    """The gain of each place is a function of where it is, the same at every yaw."""

    def __init__(self, gain_at) -> None:
        self.gain_at = gain_at
        self.batches: list[int] = []
        """How many places each call asked about."""

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: np.ndarray,
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        self.batches.append(len(positions_m))
        yaws = np.linspace(-np.pi, np.pi, 24, endpoint=False)
        gain = np.array([self.gain_at(x, y) for x, y, _ in positions_m])
        by_yaw = np.repeat(gain[:, None], len(yaws), axis=1)
        zero = np.zeros(len(gain))
        return ViewGains(
            yaws_rad=yaws,
            coverage_by_yaw=by_yaw,
            quality_by_yaw=np.zeros_like(by_yaw),
            total_by_yaw=by_yaw,
            coverage=gain,
            quality=zero,
            total=gain,
            best_yaw_rad=np.full(len(gain), yaws[0]),
        )


def cycle_on(voxels: VoxelMap, evaluator: GainEvaluator, x_m: float, y_m: float) -> PlanningCycle:
    """What a planner of a robot at this place knows of the map."""
    robot = PointRobot(ClosedWorld(np.zeros((1, 1, 1), bool)), voxels, x_m, y_m, 0.0)
    survey = Survey(NextBestViewConfig(method="test"), context_in(None), evaluator, horizon_m=6.0)
    state: RobotState = robot.state
    return survey.cycle(robot.snapshot, state)
