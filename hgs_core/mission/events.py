"""What a mission reports, as it happens: plain data, versioned, ready for JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray

from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.directives import Directives
from hgs_core.planning.plan import Insight, Plan
from hgs_core.robot.robot import RobotState
from hgs_core.sensing.frame import Frame

EVENT_SCHEMA_VERSION = 1


class MissionPhase(StrEnum):
    PREPARING = "preparing"
    RUNNING = "running"
    PAUSED = "paused"
    SUSPENDED = "suspended"
    """Saved, to be gone on with by another process; this one ends."""
    AWAITING_APPROVAL = "awaiting_approval"
    """The robot stands before a new view until the operator has decided on it."""
    RETURNING = "returning"
    """Nothing more is looked at: the robot drives back to where it began."""
    EVALUATING = "evaluating"
    ENDED = "ended"


class StopReason(StrEnum):
    """Why a mission ended."""

    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    TIME_LIMIT = "time_limit"
    STUCK = "stuck"
    PATH_BUDGET = "path_budget"
    STREAM_ENDED = "stream_ended"
    FAILED = "failed"


@dataclass(frozen=True, kw_only=True)
class MissionEvent:
    """Base: `time_s` is mission time (see `hgs_core.mission.clock`)."""

    kind: ClassVar[str]
    time_s: float

    def as_json(self) -> dict[str, Any]:
        return {"schema": EVENT_SCHEMA_VERSION, "kind": self.kind, **asdict(self)}


@dataclass(frozen=True, kw_only=True)
class PhaseChanged(MissionEvent):
    kind: ClassVar[str] = "phase"
    phase: MissionPhase
    reason: str


@dataclass(frozen=True, kw_only=True)
class Telemetry(MissionEvent):
    """After every frame taken."""

    kind: ClassVar[str] = "telemetry"
    frame: int
    x_m: float
    y_m: float
    yaw_rad: float
    path_length_m: float
    collisions: int
    n_gaussians: int
    n_keyframes: int
    observed_volume_m3: float
    missing_volume_m3: float
    psnr_current_db: float
    """Of the newest frame against the map, observed surface."""
    mapping_s: float
    """Wall seconds that mapping took for this frame, optimisation included."""
    iterations: int
    """Optimisation steps so far."""
    frames_dropped: int
    """Frames so far that fell due while mapper and planner were busy, and were never taken."""
    frames_thinned: int
    """Frames so far that showed nothing new and went into the voxels alone."""
    wall_s: float
    """Wall seconds since the mission began."""


@dataclass(frozen=True, kw_only=True)
class PlanMade(MissionEvent):
    kind: ClassVar[str] = "plan"
    plan_sequence: int
    """1, 2, ... within the mission; decisions of the operator name it."""
    reason: str
    n_candidates: int
    n_selected: int
    n_reconstructing: int
    path_length_m: float
    observed_share: float
    planning_s: float
    """T_P [s]: the sum of the three parts."""
    viewpoint_evaluation_s: float
    """T_VE [s]."""
    local_s: float
    """T_LP [s]."""
    global_s: float
    """T_GP [s]."""
    candidates: tuple[dict[str, Any], ...]
    """Each with its place, gains and `status`; what is not chosen says `why`."""
    coverage_unit: str = "m³"
    """What the candidates' `coverage` is counted in; quality is in m²."""


@dataclass(frozen=True, kw_only=True)
class DirectivesTaken(MissionEvent):
    """What is asked of the mission from now on (`hgs_core.planning.directives`)."""

    kind: ClassVar[str] = "directives"
    directives: dict[str, Any]


class ApprovalState(StrEnum):
    """What became of a view that the operator is asked about."""

    WAITING = "waiting"
    APPROVED = "approved"
    REJECTED = "rejected"
    NOT_NEEDED = "not_needed"
    """Views need no approval any more, or the plan was given up for another reason."""


@dataclass(frozen=True, kw_only=True)
class ApprovalChanged(MissionEvent):
    kind: ClassVar[str] = "approval"
    state: ApprovalState
    plan_sequence: int
    view: dict[str, float]
    """`x_m`, `y_m`, `yaw_rad` of the view that the robot wants to drive to, or was sent to."""
    reason: str


@dataclass(frozen=True, kw_only=True)
class Notice(MissionEvent):
    """Something an operator should read: `level` is info, warning or error."""

    kind: ClassVar[str] = "notice"
    level: str
    message: str


@dataclass(frozen=True, kw_only=True)
class CheckpointWritten(MissionEvent):
    """From now on a killed mission goes on from `saved_s` or later."""

    kind: ClassVar[str] = "checkpoint"
    saved_s: float
    """Mission time that it was taken at."""
    size_bytes: int
    took_s: float
    """Wall seconds that the mission waited for it."""


@dataclass(frozen=True, kw_only=True)
class Resumed(MissionEvent):
    """Another process goes on from the mission as it was at `time_s`. What an earlier one told of later times
    comes again; where it comes out the same, as by the lockstep clock, it is not told a second time
    (`hgs_core.mission.repeats`)."""

    kind: ClassVar[str] = "resumed"
    reason: str


@dataclass(frozen=True, kw_only=True)
class Halted(MissionEvent):
    """The robot was told to stand by STOP, and does. The mission's end follows when the loop comes to it."""

    kind: ClassVar[str] = "halted"
    at_s: float
    """Unix time [s] at which it stood."""
    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, kw_only=True)
class MissionEnded(MissionEvent):
    kind: ClassVar[str] = "ended"
    stop_reason: StopReason
    message: str


@dataclass(frozen=True, kw_only=True, eq=False)
class MissionView:
    """Everything a viewer may show at one moment. Arrays may be read only inside the callback."""

    time_s: float
    snapshot: MapSnapshot
    robot: RobotState
    plan: Plan | None
    insight: Insight | None
    directives: Directives
    frame: Frame
    trajectory_m: Float32[ndarray, "n 3"]
    rendered_rgb: UInt8[ndarray, "h w 3"]
    """The map drawn from the newest frame's pose, at half its resolution."""
    rendered_depth_m: Float32[ndarray, "h w"]


@runtime_checkable
class MissionObserver(Protocol):
    """Receives what happens; must return quickly and never raises into the loop."""

    def on_event(self, event: MissionEvent) -> None: ...

    def wants_view(self) -> bool:
        """Asked after every frame; views cost time to make."""
        ...

    def on_view(self, view: MissionView) -> None: ...


def rgb_to_uint8(rgb: Float32[ndarray, "h w 3"]) -> UInt8[ndarray, "h w 3"]:
    return (np.clip(rgb, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
