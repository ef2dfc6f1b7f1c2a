"""What routes depend on, taken from the application's state.

What only looks something up is `async`, although it waits for nothing: FastAPI would send it through the
pool of threads otherwise.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Annotated, Any, TypeVar

from anyio import CapacityLimiter
from fastapi import Depends, Path, Request
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection

from app.catalogue import Catalogue
from app.errors import Unauthorized
from app.logs import RecentLogs
from app.metrics import Metrics
from app.missions.mission import Mission
from app.missions.service import MissionService
from app.security.access import AccessRules
from app.security.principal import Principal, principal_of
from app.security.rates import Rates
from app.security.sessions import SessionBook
from app.security.tokens import TokenBook
from app.settings import Settings
from app.storage.audit import AuditStore
from app.storage.database import Database
from app.storage.space import Space
from app.streams import Streams
from app.viewer.scenes import Scenes

_Seen = TypeVar("_Seen")


def _state(name: str) -> Callable[[HTTPConnection], Awaitable[Any]]:
    """What the application holds under that name."""

    async def held(connection: HTTPConnection) -> Any:
        return getattr(connection.app.state, name)

    return held


async def _principal(connection: HTTPConnection) -> Principal:
    """Who was let in. Raises `Unauthorized` where nobody has to say who they are."""
    principal = principal_of(connection.scope)
    if principal is None:
        raise Unauthorized("show a token (Authorization: Bearer ...) or log in")
    return principal


SettingsDep = Annotated[Settings, Depends(_state("settings"))]
ServiceDep = Annotated[MissionService, Depends(_state("service"))]
CatalogueDep = Annotated[Catalogue, Depends(_state("catalogue"))]
ScenesDep = Annotated[Scenes | None, Depends(_state("scenes"))]
DatabaseDep = Annotated[Database, Depends(_state("database"))]
AuditDep = Annotated[AuditStore, Depends(_state("audit"))]
TokensDep = Annotated[TokenBook, Depends(_state("tokens"))]
SessionsDep = Annotated[SessionBook, Depends(_state("sessions"))]
RulesDep = Annotated[AccessRules, Depends(_state("rules"))]
RatesDep = Annotated[Rates, Depends(_state("rates"))]
StreamsDep = Annotated[Streams, Depends(_state("streams"))]
MetricsDep = Annotated[Metrics, Depends(_state("metrics"))]
SpaceDep = Annotated[Space, Depends(_state("space"))]
RecentLogsDep = Annotated[RecentLogs, Depends(_state("recent_logs"))]
StopThreadsDep = Annotated[CapacityLimiter, Depends(_state("stop_threads"))]
PrincipalDep = Annotated[Principal, Depends(_principal)]
MissionId = Annotated[str, Path(pattern=r"^[A-Za-z0-9-]{1,64}$", examples=["20260102-030405-1a2b3c4d5e6f"])]


async def _mission(mission_id: MissionId, service: ServiceDep) -> Mission:
    held = service.held(mission_id)
    return held if held is not None else await run_in_threadpool(service.get, mission_id)


MissionDep = Annotated[Mission, Depends(_mission)]


async def look_at(mission: Mission, read: Callable[[Mission], _Seen]) -> _Seen:
    """`read(mission)`, at once where it waits for nothing: a way through the pool of threads costs more."""
    return read(mission) if mission.in_memory else await run_in_threadpool(read, mission)


async def _stream_place(request: Request, principal: PrincipalDep, rates: RatesDep) -> AsyncIterator[None]:
    """A place among the client's streams for as long as the answer is being sent."""
    with rates.stream(principal.client):
        yield


StreamPlaceDep = Annotated[None, Depends(_stream_place)]
