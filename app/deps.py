"""What routes depend on, taken from the application's state."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Path
from starlette.requests import HTTPConnection

from app.catalogue import Catalogue
from app.missions.mission import Mission
from app.missions.service import MissionService
from app.settings import Settings
from app.viewer.scene import MissionScene


def _settings(connection: HTTPConnection) -> Settings:
    settings: Settings = connection.app.state.settings
    return settings


def _service(connection: HTTPConnection) -> MissionService:
    service: MissionService = connection.app.state.service
    return service


def _catalogue(connection: HTTPConnection) -> Catalogue:
    catalogue: Catalogue = connection.app.state.catalogue
    return catalogue


def _viewer(connection: HTTPConnection) -> MissionScene | None:
    viewer: MissionScene | None = connection.app.state.viewer
    return viewer


SettingsDep = Annotated[Settings, Depends(_settings)]
ServiceDep = Annotated[MissionService, Depends(_service)]
CatalogueDep = Annotated[Catalogue, Depends(_catalogue)]
ViewerDep = Annotated[MissionScene | None, Depends(_viewer)]
MissionId = Annotated[str, Path(pattern=r"^[A-Za-z0-9-]{1,64}$", examples=["20260102-030405-1a2b3c"])]


def _mission(mission_id: MissionId, service: ServiceDep) -> Mission:
    return service.get(mission_id)


MissionDep = Annotated[Mission, Depends(_mission)]
