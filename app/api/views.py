"""Missions as the API shows them."""

from __future__ import annotations

from typing import Any

from app.catalogue import time_limit_s
from app.missions.directives import without_directives
from app.missions.mission import Mission
from app.missions.moments import Moment
from app.missions.states import commands_allowed
from app.schemas import ApprovalRequest, MissionDetail, MissionFigures, MissionSummary, MomentEntry


def summary(mission: Mission) -> MissionSummary:
    return MissionSummary(**_common(mission))


def detail(mission: Mission) -> MissionDetail:
    newest, plan = mission.log.newest("telemetry"), mission.log.newest("plan")
    return MissionDetail(
        **_common(mission),
        figures=figures(newest),
        directives=mission.directives,
        approval=_approval(mission.approval),
        newest_plan=plan["sequence"] if plan is not None else None,
        time_limit_s=mission.record.max_time_s
        or time_limit_s(mission.record.preset_source, without_directives(mission.record.overrides)),
        view_sequence=mission.views.sequence,
        last_sequence=mission.log.last_sequence,
    )


def _common(mission: Mission) -> dict[str, Any]:
    record = mission.record
    return {
        "id": record.id,
        "scene": record.scene,
        "preset": record.preset,
        "seed": record.seed,
        "max_time_s": record.max_time_s,
        "clock": record.clock,
        "extends": record.extends,
        "overrides": without_directives(record.overrides),
        "state": record.state,
        "reason": record.reason,
        "phase": mission.phase,
        "stop_reason": record.stop_reason,
        "created_by": record.created_by,
        "created_at": record.created_at,
        "queued_at": record.queued_at,
        "started_at": record.started_at,
        "ended_at": record.ended_at,
        "pinned": record.pinned,
        "files": record.files,
        "commands": commands_allowed(record.state),
        "silent_s": mission.silent_s,
    }


def _approval(event: dict[str, Any] | None) -> ApprovalRequest | None:
    if event is None:
        return None
    return ApprovalRequest(**{name: event[name] for name in ApprovalRequest.model_fields})


def moment_entry(moment: Moment) -> MomentEntry:
    return MomentEntry(
        number=moment.number,
        time_s=moment.time_s,
        sequence=moment.sequence,
        path_length_m=moment.path_length_m,
    )


def figures(event: dict[str, Any] | None) -> MissionFigures | None:
    """Of a `telemetry` event, where there is one."""
    if event is None:
        return None
    return MissionFigures(**{name: event.get(name) for name in MissionFigures.model_fields})
