"""What the API says and accepts. Angles are in degrees (`_deg`), everything else in SI units."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from app.missions.display import IMAGE_KINDS
from app.missions.states import MissionState
from app.security.principal import Role
from app.storage.tables import FilesKept
from hgs_core.mission.clock import ClockKind
from hgs_core.planning.directives import Directives

PresetName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
OverrideKey = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_.]{0,99}$")]
OverrideValue = Annotated[str, StringConstraints(max_length=500)]
Overrides = Annotated[
    dict[OverrideKey, OverrideValue],
    Field(
        max_length=64,
        examples=[{"limits.max_time_s": "300"}],
        json_schema_extra={"additionalProperties": False},  # beside the keys' pattern, which pydantic states
    ),
]


class ApiModel(BaseModel):
    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True, protected_namespaces=())


class MissionCreate(ApiModel):
    """A new mission."""

    scene: str = Field("house", min_length=1, max_length=200, examples=["house", "house:3"])
    """A built-in scene or the name of a listed file."""
    preset: str = Field("paper", min_length=1, max_length=100, examples=["paper", "quick"])
    """A mission preset by name: a built-in one, or one that an operator saved."""
    seed: int = Field(0, ge=0, le=2**31 - 1, strict=True)
    max_time_s: float | None = Field(None, gt=0, le=1e6, strict=True)
    """Limit of mission time [s]; none by default."""
    clock: ClockKind | None = None
    """`lockstep`: repeatable; `real`: mapper and planner must keep up with the robot. None: the preset's."""
    overrides: Overrides = Field(default_factory=dict)
    """Settings that differ from the preset, `key.path = value`."""
    extends: str | None = Field(
        None, pattern=r"^[A-Za-z0-9-]{1,64}$", examples=["20260102-030405-1a2b3c4d5e6f"]
    )
    """A finished mission in the same scene with the same sensors: this one begins with its maps, and visits
    what is missing alone."""
    directives: Directives | None = None
    """What is asked of the mission from its beginning; none: what the preset and the overrides ask."""


class Viewpoint(ApiModel):
    x_m: float
    y_m: float
    yaw_deg: float


class ApprovalRequest(ApiModel):
    """A view that waits for the operator's word."""

    plan_sequence: int
    """The plan that wants to drive there: its number within the mission."""
    view: Viewpoint
    sequence: int
    """Number of the event that told of it."""
    time_s: float
    """Mission time since which the robot waits [s]."""


class ApprovalDecision(ApiModel):
    """The operator's word on the view that waits."""

    plan_sequence: int = Field(ge=1, le=2**31 - 1, strict=True, examples=[12])
    """The plan that is meant."""
    decision: Literal["approve", "reject"] = Field(examples=["approve"])
    """A rejected view, and its like, is not proposed again unless its surroundings change."""
    candidate: int | None = Field(None, ge=0, le=2**31 - 1, strict=True, examples=[3])
    """With `approve`: drive to this one of the plan's candidates instead, counted from 0."""

    @model_validator(mode="after")
    def _only_approval_chooses(self) -> Self:
        if self.candidate is not None and self.decision == "reject":
            raise ValueError("a candidate goes with approve alone")
        return self


class MissionFigures(ApiModel):
    """The newest telemetry."""

    sequence: int
    time_s: float
    """Mission time [s]."""
    frame: int
    x_m: float
    y_m: float
    yaw_deg: float
    path_length_m: float
    collisions: int
    n_gaussians: int
    n_keyframes: int
    observed_volume_m3: float
    missing_volume_m3: float
    psnr_current_db: float | None
    """Newest image against the map; none when it has no finite value."""
    mapping_s: float
    """Wall time of mapping for the newest frame [s]."""
    iterations: int | None
    """Optimisation steps so far; none in missions of earlier versions."""
    frames_dropped: int | None
    """Frames that fell due while mapper and planner were busy, and were never taken."""
    frames_thinned: int | None
    """Frames that showed nothing new and went into the voxels alone."""
    wall_s: float


class MissionSummary(ApiModel):
    id: str
    scene: str
    preset: str
    seed: int
    max_time_s: float | None
    clock: ClockKind | None
    """As ordered; none: the preset's."""
    extends: str | None
    """The mission whose maps it begins with."""
    overrides: dict[str, str]
    """Settings that differ from the built-in preset, a saved preset's among them."""
    created_by: str
    """Name of the token that created it; `anyone` where no tokens are set."""
    state: MissionState
    reason: str
    """Why it is in this state, in words."""
    phase: str | None
    """The mission's own word for what it does: preparing, running, paused, awaiting_approval,
    returning (to its start), evaluating, ended."""
    stop_reason: str | None
    created_at: float
    """Unix time [s]."""
    queued_at: float | None
    started_at: float | None
    ended_at: float | None
    pinned: bool
    """Its files stay, whatever room other missions need."""
    files: FilesKept
    """`all`; `light`: reports and logs are left of a finished mission; `none`."""
    commands: list[str]
    """What can be commanded now."""
    silent_s: float | None
    """Seconds since the mission process was last heard; none without a process."""


class MissionDetail(MissionSummary):
    figures: MissionFigures | None
    directives: Directives
    """What is asked of the mission; a mission that runs takes it at its next step."""
    approval: ApprovalRequest | None
    """The view that waits for the operator's word, if one does."""
    newest_plan: int | None
    """Number of the newest `plan` event, which `getPlan` gives; none before the first."""
    time_limit_s: float | None
    """Mission time at which it ends although there is more to see [s]: as ordered, or else the preset's; none
    for a mission of an earlier version whose settings are not known any more."""
    view_sequence: int
    """Number of the newest view; images and the 3D scene show it. 0 = none yet."""
    last_sequence: int
    """Number of the newest event."""


class MissionList(ApiModel):
    missions: list[MissionSummary]
    """Newest first."""
    next_cursor: str | None
    """Give this as `cursor` for the older ones; none when there are none."""
    running: list[str]
    """Missions that have a process now, oldest first."""
    queued: list[str]
    """Missions that wait for a free place, in the order in which they will start."""
    missions_at_once: int
    """How many may run beside each other."""


class EventPage(ApiModel):
    events: list[dict[str, Any]]
    """In order; each has `sequence` and `kind`."""
    more: bool
    """Whether there are more (newer ones; older ones when the newest were asked for)."""


class MetricsPage(ApiModel):
    """Figures over time, one list a column."""

    columns: dict[str, list[float | None]]
    """Of every frame."""
    plans: dict[str, list[float | None]]
    """Of every planning cycle, its parts' wall times [s] among them."""
    next_since: int
    """Give this as `since` to get only what is new."""


class GroundPose(ApiModel):
    x_m: float
    y_m: float
    yaw_deg: float


class GroundCuboid(ApiModel):
    """A subspace of the global level, from above."""

    lower_m: list[float]
    upper_m: list[float]
    state: str
    """reconstructed, reconstructing or unreconstructed."""


class TopViewFacts(ApiModel):
    """What belongs over the map from above, in metres; x to the right, y up."""

    view_sequence: int
    """Number of the view, or of the moment, that it shows."""
    time_s: float
    lower_m: list[float]
    """x and y of the picture's lower left corner."""
    upper_m: list[float]
    """x and y of its upper right corner."""
    robot: GroundPose
    field_of_view_deg: float
    """Horizontal, of the camera."""
    trajectory: list[list[float]]
    local_path: list[list[float]]
    global_tour: list[list[float]]
    subspaces: list[GroundCuboid]


class MomentEntry(ApiModel):
    """A moment of a mission that can be gone back to."""

    number: int
    time_s: float
    """Mission time [s]."""
    sequence: int
    """Number of the mission's newest event then."""
    path_length_m: float


class MomentList(ApiModel):
    moments: list[MomentEntry]
    """In the order in which they were taken."""


class MomentDetail(MomentEntry):
    figures: MissionFigures | None
    plan: dict[str, Any] | None
    """The newest `plan` event then, candidates included."""
    top_view: TopViewFacts


class SceneEntry(ApiModel):
    name: str
    kind: str
    """`built-in`, `named` (of another package), `file` or `folder`."""
    description: str


class PresetEntry(ApiModel):
    name: str
    description: str
    built_in: bool
    base: str
    """The built-in preset below it: itself, for a built-in one."""
    overrides: dict[str, str]
    """Settings of a saved preset that differ from `base`."""
    content: dict[str, Any]
    """Settings of `base`."""


class PresetSettings(ApiModel):
    """Every setting of a preset, for a form."""

    settings_schema: dict[str, Any]
    """JSON Schema (2020-12) of the settings: types, ranges, defaults, what each means. A section's properties
    are those of the planner and the sensor that the preset names."""
    values: dict[str, Any]
    """What the preset holds, defaults filled in."""
    planners: list[str]
    """What the override `planner` can name."""


class PresetSave(ApiModel):
    """A preset of your own: a built-in one with settings that differ."""

    base: str = Field(min_length=1, max_length=100, examples=["paper"])
    description: str = Field(
        "", max_length=500, pattern=r"^[^\x00]*$", examples=["Short missions for trying out"]
    )
    overrides: Overrides = Field(default_factory=dict)


class ResultFile(ApiModel):
    name: str
    """Path inside the results folder."""
    size_bytes: int
    modified_at: float
    description: str


class SystemInfo(ApiModel):
    version: str
    viewer: bool
    """Whether 3D scenes are served, at `/viewer/MISSION/`."""
    min_splat_m: float
    """Smallest radius at which the viewer draws a splat [m]."""
    max_splats: int
    """Most splats the viewer draws at once."""
    image_kinds: list[str] = list(IMAGE_KINDS)


class Health(ApiModel):
    status: str = "ok"


class Login(ApiModel):
    token: str = Field(min_length=1, max_length=500, examples=["kU1cTqTzq2cHkP6pWvXj0mY8b3e5r7t9"])
    """An operator's or a viewer's token."""


class RobotReport(ApiModel):
    """Where a live robot says that it is."""

    x_m: float
    y_m: float
    yaw_deg: float
    path_length_m: float
    standing: bool
    command: int
    """The newest command that it obeys."""
    waypoints_passed: int
    collisions: int


class RobotCommand(ApiModel):
    """What a live robot was told last."""

    type: Literal["path", "stop"]
    command: int
    """Its number; later commands have higher ones."""
    age_s: float
    """Since it was given [s]. A path is not to be taken up later than `valid_for_s` after that."""
    reason: str | None = None
    """Of a stop."""
    valid_for_s: float | None = None
    positions_m: list[list[float]] | None = None
    yaws_deg: list[float | None] | None = None
    """Heading to take up, standing, at a waypoint; null = drive on."""
    headings_deg: list[float] | None = None
    """Of a car, at every waypoint."""
    timed: dict[str, list[float]] | None = None
    """When to be where: columns `t_s`, `x_m`, `y_m`, `yaw_deg`, `speed_mps`, `curvature_1pm`."""


class RobotDetail(ApiModel):
    """A live mission's robot and the link to it; without a process there is none."""

    connected: bool
    robot: str | None
    """As it calls itself; none before its first hello."""
    connections: int
    """So far, of this process's."""
    frames: int
    """Well-formed ones that came."""
    frames_dropped: int
    """Of these, overtaken by newer ones before the mission took them."""
    missed: int
    """Reports and clouds that the mission never took, as it did not read for long."""
    refused: int
    """Messages that broke the protocol."""
    heard_at: float | None
    """When the newest message came, Unix time [s]."""
    report: RobotReport | None
    command: RobotCommand | None


class SessionInfo(ApiModel):
    login_required: bool
    """Whether tokens are set; otherwise everyone on this machine is an operator."""
    name: str | None
    """Whose token it is; none when not logged in."""
    role: Role | None
    expires_at: float | None
    """Unix time [s] at which the session ends; none without a session."""


class AuditEntry(ApiModel):
    """An attempt to change something, and what came of it."""

    id: int
    at: float
    """Unix time [s]."""
    actor: str
    """Name of the token; `anyone` where none is set, `unknown` where none was recognised."""
    role: str
    address: str
    method: str
    path: str
    status: int
    """HTTP status of the answer; from 400 on, nothing was changed."""


class AuditPage(ApiModel):
    entries: list[AuditEntry]
    """Newest first."""
    next_before: int | None
    """Give this as `before` for the older ones; none when there are none."""


class ProblemEntry(BaseModel):
    """One thing that was wrong with a request."""

    field: str
    value: Any = None
    message: str | None = None
    allowed: Any = None


class Problem(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(examples=["about:blank"])
    title: str = Field(examples=["Not possible now"])
    status: int = Field(ge=400, le=599, examples=[409])
    detail: str = Field(examples=["cannot pause mission 20260102-030405-1a2b3c4d5e6f: it is created"])
    instance: str
    """Path of the request."""
    errors: list[ProblemEntry] = Field(default_factory=list)
