"""What routes depend on, taken from the application's state.

What only looks something up is `async`, although it waits for nothing: FastAPI would send it through the
pool of threads otherwise.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated

from anyio import CapacityLimiter
from fastapi import Depends, Path, Request
from starlette.requests import HTTPConnection

from app.catalogue import Catalogue
from app.errors import Unauthorized
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
from app.streams import Streams
from app.viewer.scenes import Scenes


async def _settings(connection: HTTPConnection) -> Settings:
    settings: Settings = connection.app.state.settings
    return settings


async def _service(connection: HTTPConnection) -> MissionService:
    service: MissionService = connection.app.state.service
    return service


async def _catalogue(connection: HTTPConnection) -> Catalogue:
    catalogue: Catalogue = connection.app.state.catalogue
    return catalogue


async def _scenes(connection: HTTPConnection) -> Scenes | None:
    scenes: Scenes | None = connection.app.state.scenes
    return scenes


async def _database(connection: HTTPConnection) -> Database:
    database: Database = connection.app.state.database
    return database


async def _audit(connection: HTTPConnection) -> AuditStore:
    audit: AuditStore = connection.app.state.audit
    return audit


async def _tokens(connection: HTTPConnection) -> TokenBook:
    tokens: TokenBook = connection.app.state.tokens
    return tokens


async def _sessions(connection: HTTPConnection) -> SessionBook:
    sessions: SessionBook = connection.app.state.sessions
    return sessions


async def _rules(connection: HTTPConnection) -> AccessRules:
    rules: AccessRules = connection.app.state.rules
    return rules


async def _rates(connection: HTTPConnection) -> Rates:
    rates: Rates = connection.app.state.rates
    return rates


async def _streams(connection: HTTPConnection) -> Streams:
    streams: Streams = connection.app.state.streams
    return streams


async def _stop_threads(connection: HTTPConnection) -> CapacityLimiter:
    threads: CapacityLimiter = connection.app.state.stop_threads
    return threads


async def _principal(connection: HTTPConnection) -> Principal:
    """Who was let in. Raises `Unauthorized` where nobody has to say who they are."""
    principal = principal_of(connection.scope)
    if principal is None:
        raise Unauthorized("show a token (Authorization: Bearer ...) or log in")
    return principal


SettingsDep = Annotated[Settings, Depends(_settings)]
ServiceDep = Annotated[MissionService, Depends(_service)]
CatalogueDep = Annotated[Catalogue, Depends(_catalogue)]
ScenesDep = Annotated[Scenes | None, Depends(_scenes)]
DatabaseDep = Annotated[Database, Depends(_database)]
AuditDep = Annotated[AuditStore, Depends(_audit)]
TokensDep = Annotated[TokenBook, Depends(_tokens)]
SessionsDep = Annotated[SessionBook, Depends(_sessions)]
RulesDep = Annotated[AccessRules, Depends(_rules)]
RatesDep = Annotated[Rates, Depends(_rates)]
StreamsDep = Annotated[Streams, Depends(_streams)]
StopThreadsDep = Annotated[CapacityLimiter, Depends(_stop_threads)]
PrincipalDep = Annotated[Principal, Depends(_principal)]
MissionId = Annotated[str, Path(pattern=r"^[A-Za-z0-9-]{1,64}$", examples=["20260102-030405-1a2b3c4d5e6f"])]


def _mission(mission_id: MissionId, service: ServiceDep) -> Mission:
    return service.get(mission_id)


MissionDep = Annotated[Mission, Depends(_mission)]


async def _stream_place(request: Request, principal: PrincipalDep, rates: RatesDep) -> AsyncIterator[None]:
    """A place among the client's streams for as long as the answer is being sent."""
    with rates.stream(principal.client):
        yield


StreamPlaceDep = Annotated[None, Depends(_stream_place)]
