"""What a report of a fault needs."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.responses import StreamingResponse

from app.archive import zipped
from app.bundle import bundle_of
from app.deps import MissionDep, PrincipalDep, RecentLogsDep, SettingsDep
from app.errors import Forbidden
from app.openapi import problems
from app.security.principal import Role

router = APIRouter(prefix="/missions", tags=["results"])

_MOST_EVENTS = 20_000


@router.get(
    "/{mission_id}/bundle",
    operation_id="downloadBundle",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "A ZIP",
            "content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}},
        },
        **problems(404),
    },
)
def download_bundle(
    mission: MissionDep, settings: SettingsDep, recent_logs: RecentLogsDep, principal: PrincipalDep
) -> StreamingResponse:
    """Everything for a report of a fault: settings, versions, logs, events, report, last view, machine. For
    operators, as the service's log tells who did what; nothing in it is secret."""
    if principal.role is not Role.OPERATOR:
        raise Forbidden(f"{principal.name} is a {principal.role}; the bundle is for operators")
    events, more = mission.log.history(limit=_MOST_EVENTS, newest=True)
    content = bundle_of(
        mission.folder,
        record=mission.record,
        events=events,
        service_log=recent_logs.lines(),
        settings=settings.model_dump(mode="json"),
        remarks=[f"events before the newest {_MOST_EVENTS} are left out"] if more else [],
    )
    return StreamingResponse(
        zipped({f"{mission.id}/{name}": part for name, part in content.items()}, compressed=True),
        media_type="application/zip",
        headers={"Content-Disposition": f'attachment; filename="{mission.id}-bundle.zip"'},
    )
