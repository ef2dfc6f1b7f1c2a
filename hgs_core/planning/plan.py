"""A plan that explains itself: the viewer, the log and the tests read the same object."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.gain.viewpoint import GainPanorama
from hgs_core.geometry.boxes import Box
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.directives import Directives
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState


class SubspaceState(StrEnum):
    """HGS-Planner section III-D: observed voxels only, both kinds, unobserved voxels only."""

    RECONSTRUCTED = "reconstructed"
    RECONSTRUCTING = "reconstructing"
    UNRECONSTRUCTED = "unreconstructed"


class CandidateStatus(StrEnum):
    """What became of a candidate viewpoint, and why."""

    SELECTED = "selected"
    BELOW_THRESHOLD = "below_threshold"
    UNREACHABLE = "unreachable"
    CROSSING = "crossing"
    """A crossing of the global path with the horizon: stays whatever its gain."""
    OUTRANKED = "outranked"
    """Worth a stop, but others come first."""


class UnseenReason(StrEnum):
    """Why a region was left unseen."""

    UNREACHABLE = "unreachable"
    BELOW_THRESHOLD = "below_threshold"
    OCCLUDED = "occluded"
    OUT_OF_BOUNDS = "out_of_bounds"
    OUTSIDE_REGION = "outside_region"
    """It lies outside the region that the operator asked for."""
    NO_GO = "no_go"
    """A no-go area keeps the robot from where it could be looked at."""
    PATH_BUDGET = "path_budget"
    """What is left of the path budget does not lead to where it could be looked at."""
    TIME_LIMIT = "time_limit"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One place that was considered. Gains are those of the best yaw."""

    x_m: float
    y_m: float
    z_m: float
    yaw_rad: float
    coverage_gain: float
    quality_gain: float
    total_gain: float
    status: CandidateStatus
    why: str = ""
    """For an operator: why the robot does not go there; empty for what is selected."""

    @staticmethod
    def unreachable(middle_m: Float[ndarray, " 2"], z_m: float) -> Candidate:
        """What is missing around `middle_m`, and no reachable place can look at."""
        return Candidate(
            x_m=float(middle_m[0]),
            y_m=float(middle_m[1]),
            z_m=z_m,
            yaw_rad=0.0,
            coverage_gain=0.0,
            quality_gain=0.0,
            total_gain=0.0,
            status=CandidateStatus.UNREACHABLE,
            why="no place that the robot can reach looks at what is missing here",
        )

    @staticmethod
    def restore(state: dict[str, Any]) -> Candidate:
        return Candidate(**{**state, "status": CandidateStatus(state["status"])})


@dataclass(frozen=True, kw_only=True)
class Subspace:
    """One cuboid of the global level."""

    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]
    state: SubspaceState
    missing_volume_m3: float

    @staticmethod
    def restore(state: dict[str, Any]) -> Subspace:
        lower, upper = tuple(state["lower_m"]), tuple(state["upper_m"])
        return Subspace(
            **{**state, "lower_m": lower, "upper_m": upper, "state": SubspaceState(state["state"])}
        )


@dataclass(frozen=True, kw_only=True)
class PlanningTimes:
    """Wall seconds of one cycle; `total_s` = T_P = T_VE + T_LP + T_GP (HGS-Planner section IV-B)."""

    viewpoint_evaluation_s: float
    local_s: float
    global_s: float

    @property
    def total_s(self) -> float:
        return self.viewpoint_evaluation_s + self.local_s + self.global_s


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Where to drive and look next, and everything that led to it.

    `path` begins at the robot and passes the selected viewpoints in order. `global_tour_m` and
    `local_path_m` are polylines for display; the executed path is `path` alone.
    """

    path: Path
    candidates: tuple[Candidate, ...]
    subspaces: tuple[Subspace, ...]
    global_tour_m: Float[ndarray, "n_tour 3"]
    local_path_m: Float[ndarray, "n_local 3"]
    horizon: Box
    observed_share: float
    """lambda_o: the share of the horizon's voxels that have been observed (HGS-Planner Eq. 10)."""
    reason: str
    """One sentence for an operator: why this and not something else."""
    times: PlanningTimes
    coverage_unit: str = "m³"
    """What the candidates' coverage gain is counted in."""

    def state(self) -> dict[str, Any]:
        """All of it as plain data."""
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return {
            **plain,
            "path": self.path.state(),
            "candidates": [asdict(candidate) for candidate in self.candidates],
            "subspaces": [asdict(subspace) for subspace in self.subspaces],
            "horizon": {"lower_m": self.horizon.lower_m, "upper_m": self.horizon.upper_m},
            "times": asdict(self.times),
        }

    @staticmethod
    def restore(state: dict[str, Any]) -> Plan:
        parts = {
            "path": Path(**state["path"]),
            "candidates": tuple(Candidate.restore(entry) for entry in state["candidates"]),
            "subspaces": tuple(Subspace.restore(entry) for entry in state["subspaces"]),
            "horizon": Box(**state["horizon"]),
            "times": PlanningTimes(**state["times"]),
        }
        return Plan(**{**state, **parts})


def on_floor(polyline_m: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    """A polyline of the plane at height 0."""
    return np.column_stack([polyline_m, np.zeros(len(polyline_m))])


@dataclass(frozen=True, kw_only=True)
class UnseenRegion:
    """A region that the mission leaves unseen."""

    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]
    volume_m3: float
    reason: UnseenReason

    @staticmethod
    def restore(state: dict[str, Any]) -> UnseenRegion:
        lower, upper = tuple(state["lower_m"]), tuple(state["upper_m"])
        return UnseenRegion(
            **{**state, "lower_m": lower, "upper_m": upper, "reason": UnseenReason(state["reason"])}
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class NothingLeft:
    """The planner's answer when no place is worth going to: what stays unseen, and why."""

    unseen: tuple[UnseenRegion, ...]
    candidates: tuple[Candidate, ...]
    subspaces: tuple[Subspace, ...]
    times: PlanningTimes
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Insight:
    """What a planner can show of its work, for people alone."""

    view_m: Float[ndarray, " 3"] | None
    """Where the plan looks from next; None when it looks at nothing."""
    panorama: GainPanorama | None
    """What would be gained there in each direction, on the newest maps; None where its gain shows none."""
    roadmap_m: Float[ndarray, "n_edges 2 2"]
    """Both ends of the roadmap's edges that can be driven; none of a planner without one."""


@runtime_checkable
class Insightful(Protocol):
    """A planner that shows its work."""

    def insight(self, snapshot: MapSnapshot, plan: Plan | None) -> Insight: ...


@runtime_checkable
class Planner(Protocol):
    """Decides where to look next from the maps and the robot's state alone."""

    def plan(self, snapshot: MapSnapshot, robot: RobotState, rng: np.random.Generator) -> Plan | NothingLeft:
        """One planning cycle."""
        ...

    def should_replan(
        self, snapshot: MapSnapshot, robot: RobotState, plan: Plan, waypoints_passed: int
    ) -> str | None:
        """Why the plan under way should be dropped (blocked, target already seen, ...), or None.

        Called after every integrated frame: cheap. A blocked path must always be reported.
        """
        ...

    def unseen(self, snapshot: MapSnapshot, robot: RobotState) -> tuple[UnseenRegion, ...]:
        """What is unseen now, and why (used when a mission ends for another reason)."""
        ...

    def obey(self, directives: Directives, start_xy_m: Float[ndarray, " 2"]) -> None:
        """Plan within these from now on. The mission began at `start_xy_m`."""
        ...

    def refuse(self, snapshot: MapSnapshot, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Do not propose this view again, nor its like, as long as its surroundings stay as they are."""
        ...

    def adopt(self, snapshot: MapSnapshot, robot: RobotState, plan: Plan) -> None:
        """This plan is under way in place of the one that was made last."""
        ...

    def state(self) -> dict[str, Any]: ...

    def restore(self, state: dict[str, Any]) -> None: ...
