"""Why the robot drives where it does: the newest plan."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Header, Response, status

from app.deps import MissionDep, StreamsDep, look_at
from app.errors import NotFound
from app.openapi import problems

router = APIRouter(prefix="/missions", tags=["missions"])


@router.get(
    "/{mission_id}/plan",
    operation_id="getPlan",
    response_model=dict[str, Any],
    responses={
        200: {"description": "The `plan` event; ETag is its number"},
        304: {"description": "Still the plan that If-None-Match names"},
        **problems(404),
    },
)
async def get_plan(
    mission: MissionDep,
    streams: StreamsDep,
    if_none_match: Annotated[str | None, Header(max_length=500)] = None,
) -> Response:
    """The newest plan with all its candidates, and why each was chosen or not."""
    plan = await look_at(mission, lambda mission: mission.log.newest("plan"))
    if plan is None:
        raise NotFound(f"mission {mission.id} has no plan (yet)")
    tag = f'"{mission.id}-plan-{plan["sequence"]}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    if if_none_match is not None and tag in if_none_match:
        return Response(status_code=status.HTTP_304_NOT_MODIFIED, headers=headers)
    encoded = streams.texts.of(mission.id, plan).bytes
    return Response(encoded, media_type="application/json", headers=headers)
