"""What the API says and accepts. Angles are in degrees (`_deg`), everything else in SI units."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from app.missions.display import IMAGE_KINDS
from app.missions.states import MissionState
from hgs_core.mission.clock import ClockKind

OverrideKey = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_.]{0,99}$")]
OverrideValue = Annotated[str, StringConstraints(max_length=500)]


class ApiModel(BaseModel):
    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True, protected_namespaces=())


class MissionCreate(ApiModel):
    """A new mission."""

    scene: str = Field("house", min_length=1, max_length=200, examples=["house", "house:3"])
    """A built-in scene or the name of a listed file."""
    preset: str = Field("paper", min_length=1, max_length=100)
    """A mission preset by name."""
    seed: int = Field(0, ge=0, le=2**31 - 1)
    max_time_s: float | None = Field(None, gt=0, le=1e6)
    """Limit of mission time [s]; none by default."""
    clock: ClockKind | None = None
    """`lockstep`: repeatable; `real`: mapper and planner must keep up with the robot. None: the preset's."""
    overrides: dict[OverrideKey, OverrideValue] = Field(default_factory=dict, max_length=64)
    """Settings that differ from the preset, `key.path = value`."""


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
    overrides: dict[str, str]
    state: MissionState
    reason: str
    """Why it is in this state, in words."""
    phase: str | None
    """The mission's own word for what it does: preparing, running, paused, evaluating, ended."""
    stop_reason: str | None
    created_at: float
    """Unix time [s]."""
    started_at: float | None
    ended_at: float | None
    commands: list[str]
    """What can be commanded now."""
    silent_s: float | None
    """Seconds since the mission process was last heard; none without a process."""


class MissionDetail(MissionSummary):
    figures: MissionFigures | None
    plan: dict[str, Any] | None
    """The newest `plan` event, candidates included."""
    view_sequence: int
    """Number of the newest view; images and the 3D scene show it. 0 = none yet."""
    last_sequence: int
    """Number of the newest event."""


class MissionList(ApiModel):
    missions: list[MissionSummary]
    running: str | None
    """The mission that has a process now."""
    in_scene: str | None
    """The mission that the 3D scene shows."""


class EventPage(ApiModel):
    events: list[dict[str, Any]]
    """In order; each has `sequence` and `kind`."""
    more: bool
    """Whether there are more (newer ones; older ones when the newest were asked for)."""


class MetricsPage(ApiModel):
    """Figures over time, one list a column."""

    columns: dict[str, list[float | None]]
    next_since: int
    """Give this as `since` to get only what is new."""


class SceneEntry(ApiModel):
    name: str
    kind: str
    """`built-in`, `named` (of another package), `file` or `folder`."""
    description: str


class PresetEntry(ApiModel):
    name: str
    description: str
    content: dict[str, Any]


class ResultFile(ApiModel):
    name: str
    """Path inside the results folder."""
    size_bytes: int
    modified_at: float
    description: str


class SystemInfo(ApiModel):
    version: str
    viewer_url: str | None
    """Where the 3D scene is served; none when the viewer is off."""
    min_splat_m: float
    """Smallest radius at which the viewer draws a splat [m]."""
    max_splats: int
    """Most splats the viewer draws at once."""
    image_kinds: list[str] = list(IMAGE_KINDS)


class Health(ApiModel):
    status: str = "ok"
