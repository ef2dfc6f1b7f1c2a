"""Missions: create, command, look at."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Header, Query, Response, status

from app.api.views import detail, summary
from app.deps import CatalogueDep, MissionDep, MissionId, ServiceDep, ViewerDep
from app.missions.mission import Mission
from app.schemas import MetricsPage, MissionCreate, MissionDetail, MissionList

router = APIRouter(prefix="/missions", tags=["missions"])

METRIC_COLUMNS = (
    "sequence",
    "time_s",
    "wall_s",
    "path_length_m",
    "observed_volume_m3",
    "missing_volume_m3",
    "psnr_current_db",
    "n_gaussians",
    "n_keyframes",
    "mapping_s",
    "iterations",
    "frames_dropped",
    "frames_thinned",
    "collisions",
)


@router.get("", operation_id="listMissions")
def list_missions(service: ServiceDep, viewer: ViewerDep) -> MissionList:
    """All missions, newest first."""
    running = service.running()
    return MissionList(
        missions=[summary(mission) for mission in service.missions()],
        running=running.id if running is not None else None,
        in_scene=viewer.mission_id if viewer is not None else None,
    )


@router.post("", status_code=status.HTTP_201_CREATED, operation_id="createMission")
def create_mission(
    wish: MissionCreate,
    service: ServiceDep,
    catalogue: CatalogueDep,
    response: Response,
    idempotency_key: Annotated[str | None, Header(max_length=200, min_length=1)] = None,
) -> MissionDetail:
    """Create a mission; it waits for start. The same Idempotency-Key gives the same mission (then 200)."""
    mission, is_new = service.create(catalogue.order(wish), idempotency_key=idempotency_key)
    if not is_new:
        response.status_code = status.HTTP_200_OK
    response.headers["Location"] = f"/api/v1/missions/{mission.id}"
    return detail(mission)


@router.get("/{mission_id}", operation_id="getMission")
def get_mission(mission: MissionDep) -> MissionDetail:
    return detail(mission)


@router.post("/{mission_id}/start", status_code=status.HTTP_202_ACCEPTED, operation_id="startMission")
def start_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    """Launch the mission's process. One mission runs at a time."""
    return detail(service.start(mission_id))


@router.post("/{mission_id}/pause", status_code=status.HTTP_202_ACCEPTED, operation_id="pauseMission")
def pause_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    return detail(service.pause(mission_id))


@router.post("/{mission_id}/resume", status_code=status.HTTP_202_ACCEPTED, operation_id="resumeMission")
def resume_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    return detail(service.resume(mission_id))


@router.post("/{mission_id}/stop", status_code=status.HTTP_202_ACCEPTED, operation_id="stopMission")
def stop_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    """Stop; the mission then evaluates what it has and writes its results. Safe to repeat."""
    return detail(service.stop(mission_id))


@router.get("/{mission_id}/metrics", operation_id="getMetrics")
def get_metrics(
    mission: MissionDep,
    since: Annotated[int, Query(ge=0, description="Only figures newer than this sequence number")] = 0,
    limit: Annotated[int, Query(ge=2, le=20_000, description="Thin evenly to at most so many rows")] = 2_000,
) -> MetricsPage:
    """Figures over time."""
    return _metrics(mission, since, limit)


def _metrics(mission: Mission, since: int, limit: int) -> MetricsPage:
    rows = mission.log.telemetry(after=since)
    next_since = int(rows[-1]["sequence"]) if rows else since
    if len(rows) > limit:
        last = len(rows) - 1
        rows = [rows[round(k * last / (limit - 1))] for k in range(limit)]
    columns = {name: [row.get(name) for row in rows] for name in METRIC_COLUMNS}
    return MetricsPage(columns=columns, next_since=next_since)
