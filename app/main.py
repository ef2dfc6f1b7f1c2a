"""The web service: REST, WebSocket, the operator page and the 3D viewer in one process.

Missions run in processes of their own (`app.missions`).
"""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from pathlib import Path

import uvicorn
from fastapi import APIRouter, FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool

from app.api import events, images, missions, results, scenes, system
from app.catalogue import Catalogue
from app.errors import install_error_handlers
from app.missions.service import DEFAULT_RUNNER, MissionService
from app.schemas import MissionCreate
from app.security import LocalOnly
from app.settings import Settings, require_loopback, settings_from_environment, static_root
from app.viewer.scene import MissionScene

log = logging.getLogger(__name__)

_SHUTDOWN_S = 5
"""How long open connections may finish when the service stops [s]."""


def create_app(settings: Settings, *, runner: str = DEFAULT_RUNNER) -> FastAPI:
    """The service as an ASGI application. `runner` is what a mission process calls (see `MissionService`)."""
    require_loopback(settings.host)
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    service = MissionService(settings, runner=runner)
    catalogue = Catalogue(settings.scenes_dir)
    viewer = MissionScene(settings.display) if settings.viewer else None

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if viewer is not None:
            service.add_view_listener(viewer.show)
        if settings.demo:
            await run_in_threadpool(_start_demo, service, catalogue, settings)
        yield
        await run_in_threadpool(service.shutdown)
        if viewer is not None:
            await run_in_threadpool(viewer.close)

    app = FastAPI(title="hgs", version=version("hgs"), lifespan=lifespan, docs_url=None, redoc_url=None)
    app.state.settings = settings
    app.state.service = service
    app.state.catalogue = catalogue
    app.state.viewer = viewer
    install_error_handlers(app)
    api = APIRouter(prefix="/api/v1")
    for module in (scenes, missions, events, images, results, system):
        api.include_router(module.router)
    app.include_router(api)
    app.include_router(system.health_router)
    app.mount("/", StaticFiles(directory=static_root(), html=True), name="operator page")
    app.add_middleware(LocalOnly, viewer_origin=viewer.url if viewer is not None else None)
    return app


def serve(host: str, port: int, data_dir: Path, demo: bool) -> None:
    """Serve until SIGINT or SIGTERM. Raises `ConfigError` for an address that is not this machine's own."""
    settings = settings_from_environment(host=host, port=port, data_dir=data_dir, demo=demo)
    uvicorn.run(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        workers=1,
        log_level="warning",
        timeout_graceful_shutdown=_SHUTDOWN_S,
        ws_per_message_deflate=False,
    )


def _start_demo(service: MissionService, catalogue: Catalogue, settings: Settings) -> None:
    order = catalogue.order(MissionCreate(scene="house", preset=settings.demo_preset))
    mission, _ = service.create(order)
    service.start(mission.id)
