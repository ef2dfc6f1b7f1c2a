"""Missions: create, command, look at."""

from __future__ import annotations

import hashlib
from itertools import compress
from typing import Annotated, TypeVar

from anyio import to_thread
from fastapi import APIRouter, Header, Query, Response, status

from app.api.views import detail, summary
from app.deps import (
    CatalogueDep,
    MissionDep,
    MissionId,
    PrincipalDep,
    ServiceDep,
    SettingsDep,
    StopThreadsDep,
    look_at,
)
from app.missions.mission import Mission
from app.missions.service import Idempotency
from app.missions.states import MissionState
from app.openapi import problems
from app.schemas import ApprovalDecision, MetricsPage, MissionCreate, MissionDetail, MissionList
from hgs_core.mission.commands import Decide
from hgs_core.mission.repeats import newest_course
from hgs_core.planning.directives import Directives

router = APIRouter(prefix="/missions", tags=["missions"])

_CURSOR = r"^[0-9]{1,12}(\.[0-9]{1,12})?~[A-Za-z0-9-]{1,64}$"
_MOST_ROWS = 20_000
_Row = TypeVar("_Row")

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

PLAN_COLUMNS = (
    "time_s",
    "planning_s",
    "viewpoint_evaluation_s",
    "local_s",
    "global_s",
    "n_candidates",
    "n_selected",
    "observed_share",
)

_Refusable = problems(404, 409)


@router.get("", operation_id="listMissions")
def list_missions(
    service: ServiceDep,
    settings: SettingsDep,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
    cursor: Annotated[
        str | None,
        Query(pattern=_CURSOR, max_length=100, description="`next_cursor` of the page before"),
    ] = None,
    state: Annotated[
        list[MissionState] | None, Query(description="Only these states; repeat for several", max_length=20)
    ] = None,
) -> MissionList:
    """Missions, newest first, a page at a time."""
    found = service.page(limit + 1, before=_parsed(cursor), states=state)
    shown = found[:limit]
    last = shown[-1].record if shown else None
    return MissionList(
        missions=[summary(mission) for mission in shown],
        next_cursor=f"{last.created_at!r}~{last.id}" if last is not None and len(found) > limit else None,
        running=[mission.id for mission in service.running()],
        queued=[mission.id for mission in service.queued()],
        missions_at_once=settings.missions_at_once,
    )


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    operation_id="createMission",
    responses={
        201: {"headers": {"Location": {"schema": {"type": "string"}, "description": "Of the new mission"}}},
        200: {"model": MissionDetail, "description": "The mission that this Idempotency-Key made before"},
        **problems(409, 507),
    },
)
def create_mission(
    wish: MissionCreate,
    service: ServiceDep,
    catalogue: CatalogueDep,
    principal: PrincipalDep,
    response: Response,
    idempotency_key: Annotated[
        str | None,
        Header(max_length=200, min_length=1, pattern=r"^[\x21-\x7e]+$", examples=["2f1c6a1e-9a7e"]),
    ] = None,
) -> MissionDetail:
    """Create a mission; it waits for start. The same Idempotency-Key gives the same mission (then 200)."""
    once = _idempotency(idempotency_key, wish)
    mission = service.replay(once) if once is not None else None
    is_new = False
    if mission is None:
        order = catalogue.order(wish)
        service.check_extended(order)
        mission, is_new = service.create(order, idempotency=once, created_by=principal.name)
    if not is_new:
        response.status_code = status.HTTP_200_OK
    response.headers["Location"] = f"/api/v1/missions/{mission.id}"
    return detail(mission)


@router.get("/{mission_id}", operation_id="getMission", response_model=MissionDetail, responses=problems(404))
async def get_mission(mission: MissionDep) -> Response:
    """State, reason and newest figures. Quick to give, and small: asked for again and again."""
    seen = await look_at(mission, detail)
    # Written here: what comes from a model needs no second validation.
    return Response(seen.model_dump_json(), media_type="application/json")


@router.post(
    "/{mission_id}/start",
    status_code=status.HTTP_202_ACCEPTED,
    operation_id="startMission",
    responses={**_Refusable, **problems(507)},
)
def start_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    """Launch the mission's process, or queue the mission when as many run as may at once."""
    return detail(service.start(mission_id))


@router.post(
    "/{mission_id}/pause",
    status_code=status.HTTP_202_ACCEPTED,
    operation_id="pauseMission",
    responses=_Refusable,
)
def pause_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    return detail(service.pause(mission_id))


@router.post(
    "/{mission_id}/resume",
    status_code=status.HTTP_202_ACCEPTED,
    operation_id="resumeMission",
    responses=_Refusable,
)
def resume_mission(mission_id: MissionId, service: ServiceDep) -> MissionDetail:
    """Let a paused mission go on, or an interrupted one from its last checkpoint, in a process of its own (or
    queue it)."""
    return detail(service.resume(mission_id))


@router.post(
    "/{mission_id}/stop",
    status_code=status.HTTP_202_ACCEPTED,
    operation_id="stopMission",
    responses=problems(404),
)
async def stop_mission(mission_id: MissionId, service: ServiceDep, threads: StopThreadsDep) -> MissionDetail:
    """Stop; the mission then evaluates what it has and writes its results. Safe to repeat, in any state."""
    # Threads of its own: however many other requests wait for the database, STOP does not wait with them.
    return await to_thread.run_sync(lambda: detail(service.stop(mission_id)), limiter=threads)


@router.put("/{mission_id}/pin", operation_id="pinMission", responses=problems(404))
def pin_mission(mission: MissionDep, principal: PrincipalDep) -> MissionDetail:
    """Keep the mission's files, whatever room other missions need."""
    mission.pin(True, principal.name)
    return detail(mission)


@router.delete("/{mission_id}/pin", operation_id="unpinMission", responses=problems(404))
def unpin_mission(mission: MissionDep, principal: PrincipalDep) -> MissionDetail:
    """Let the mission's files go when their turn comes."""
    mission.pin(False, principal.name)
    return detail(mission)


@router.get("/{mission_id}/directives", operation_id="getDirectives", responses=problems(404))
def get_directives(mission: MissionDep) -> Directives:
    """What is asked of the mission: region of interest, no-go areas, budgets, approval of views."""
    return mission.directives


@router.put("/{mission_id}/directives", operation_id="putDirectives", responses=_Refusable)
def put_directives(mission_id: MissionId, wish: Directives, service: ServiceDep) -> Directives:
    """Ask this of the mission from now on, in place of all that was asked before.

    A mission that runs takes it at its next step and tells so by an event `directives`, and by a `notice` of
    what cannot be kept.
    """
    return service.direct(mission_id, wish).directives


@router.post(
    "/{mission_id}/approval",
    status_code=status.HTTP_202_ACCEPTED,
    operation_id="decideApproval",
    responses=_Refusable,
)
def decide_approval(mission_id: MissionId, wish: ApprovalDecision, service: ServiceDep) -> MissionDetail:
    """Let the robot drive to the view that waits, or to another candidate of the plan, or reject it."""
    decision = Decide(
        plan_sequence=wish.plan_sequence,
        approved=wish.decision == "approve",
        candidate=wish.candidate,
    )
    return detail(service.decide(mission_id, decision))


@router.get("/{mission_id}/metrics", operation_id="getMetrics", responses=problems(404))
def get_metrics(
    mission: MissionDep,
    since: Annotated[
        int, Query(ge=0, le=2**31 - 1, description="Only figures newer than this sequence number")
    ] = 0,
    limit: Annotated[int, Query(ge=2, le=20_000, description="Thin evenly to at most so many rows")] = 2_000,
) -> MetricsPage:
    """Figures over time."""
    return _metrics(mission, since, limit)


def _metrics(mission: Mission, since: int, limit: int) -> MetricsPage:
    end = mission.log.last_sequence + 1  # the same end for both, so that none is told twice or left out
    rows, _ = mission.log.history(after=since, before=end, limit=_MOST_ROWS, kinds=["telemetry"], newest=True)
    rows = list(compress(rows, newest_course([row["time_s"] for row in rows])))
    shown = _thinned(rows, limit)
    columns = {name: [row.get(name) for row in shown] for name in METRIC_COLUMNS}
    plans = mission.log.columns("plan", PLAN_COLUMNS, after=since, before=end, limit=_MOST_ROWS)
    plans = list(compress(plans, newest_course([time_s or 0.0 for _, time_s, *_ in plans])))
    by_column = (
        zip(*_thinned(plans, limit), strict=True) if plans else ([] for _ in range(len(PLAN_COLUMNS) + 1))
    )
    return MetricsPage(
        columns=columns,
        plans=dict(zip(("sequence", *PLAN_COLUMNS), map(list, by_column), strict=True)),
        next_since=max(since, end - 1),
    )


def _thinned(rows: list[_Row], limit: int) -> list[_Row]:
    """At most `limit`, evenly spread, the first and the last among them."""
    if len(rows) <= limit:
        return rows
    return [rows[round(k * (len(rows) - 1) / (limit - 1))] for k in range(limit)]


def _idempotency(key: str | None, wish: MissionCreate) -> Idempotency | None:
    if key is None:
        return None
    return Idempotency(key=key, digest=hashlib.sha256(wish.model_dump_json().encode()).hexdigest())


def _parsed(cursor: str | None) -> tuple[float, str] | None:
    if cursor is None:
        return None
    created_at, _, mission_id = cursor.partition("~")
    return float(created_at), mission_id
