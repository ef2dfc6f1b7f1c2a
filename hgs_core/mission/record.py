"""What a mission did, for its report."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from hgs_core.geometry.se3 import SE3
from hgs_core.mission.events import StopReason
from hgs_core.planning.plan import PlanningTimes, UnseenRegion


@dataclass(kw_only=True)
class MissionRecord:
    """What a mission did, for its report."""

    timestamps_s: list[float] = field(default_factory=list)
    poses: list[SE3] = field(default_factory=list)
    sensing_s: list[float] = field(default_factory=list)
    """Wall seconds of delivering each frame and scan: the simulator's."""
    mapping_s: list[float] = field(default_factory=list)
    """Wall seconds of mapping for each frame: taking in scan and frame, and the steps that followed."""
    iterations: int = 0
    """Optimisation steps so far."""
    frames_dropped: int = 0
    """Frames that fell due while the mapper or the planner was busy, and were never taken."""
    frames_thinned: int = 0
    """Frames taken that showed nothing new: they went into the voxels alone."""
    planning: list[PlanningTimes] = field(default_factory=list)
    stop_reason: StopReason | None = None
    message: str = ""
    unseen: tuple[UnseenRegion, ...] = ()

    def state(self) -> dict[str, Any]:
        """As far as it has come while the mission goes on: why it ended is not part of it."""
        plain = {name: getattr(self, name) for name in _COUNTED}
        measured = {name: np.array(getattr(self, name), dtype=float) for name in _MEASURED}
        planning = [(t.viewpoint_evaluation_s, t.local_s, t.global_s) for t in self.planning]
        return {
            **plain,
            **measured,
            "poses": np.array([pose.as_matrix() for pose in self.poses]).reshape(-1, 4, 4),
            "planning": np.array(planning, dtype=float).reshape(-1, 3),
        }

    @staticmethod
    def restore(state: dict[str, Any]) -> MissionRecord:
        plain: dict[str, Any] = {name: int(state[name]) for name in _COUNTED}
        measured: dict[str, Any] = {name: state[name].tolist() for name in _MEASURED}
        return MissionRecord(
            **plain,
            **measured,
            poses=[SE3.from_matrix(matrix.copy()) for matrix in state["poses"]],
            planning=[
                PlanningTimes(viewpoint_evaluation_s=evaluation_s, local_s=local_s, global_s=global_s)
                for evaluation_s, local_s, global_s in state["planning"].tolist()
            ],
        )


_COUNTED: Final = ("iterations", "frames_dropped", "frames_thinned")
_MEASURED: Final = ("timestamps_s", "sensing_s", "mapping_s")
