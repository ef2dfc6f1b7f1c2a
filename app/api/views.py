"""Missions as the API shows them."""

from __future__ import annotations

from typing import Any

from app.missions.mission import Mission
from app.missions.states import commands_allowed
from app.schemas import MissionDetail, MissionFigures, MissionSummary


def summary(mission: Mission) -> MissionSummary:
    return MissionSummary(**_common(mission))


def detail(mission: Mission) -> MissionDetail:
    newest = mission.log.newest("telemetry")
    return MissionDetail(
        **_common(mission),
        figures=_figures(newest) if newest is not None else None,
        plan=mission.log.newest("plan"),
        view_sequence=mission.view_sequence,
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
        "overrides": record.overrides,
        "state": record.state,
        "reason": record.reason,
        "phase": mission.phase,
        "stop_reason": record.stop_reason,
        "created_by": record.created_by,
        "created_at": record.created_at,
        "queued_at": record.queued_at,
        "started_at": record.started_at,
        "ended_at": record.ended_at,
        "commands": commands_allowed(record.state),
        "silent_s": mission.silent_s,
    }


def _figures(event: dict[str, Any]) -> MissionFigures:
    return MissionFigures(**{name: event.get(name) for name in MissionFigures.model_fields})
