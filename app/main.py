"""The web service: REST, WebSocket, the operator page and the 3D viewer in one process.

Missions run in processes of their own (`app.missions`).
"""

from __future__ import annotations

import socket
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from importlib.metadata import version

from anyio import CapacityLimiter
from fastapi import APIRouter, FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.concurrency import run_in_threadpool

from app.api import (
    bundle,
    events,
    images,
    ingest,
    missions,
    moments,
    plans,
    results,
    scenes,
    session,
    system,
    viewer,
)
from app.catalogue import Catalogue
from app.errors import install_error_handlers
from app.logs import RecentLogs, configure_logging
from app.metrics import Metrics
from app.missions.retention import Retention
from app.missions.service import DEFAULT_RUNNER, MissionService
from app.openapi import install_openapi
from app.requests import API_PREFIX, Requests
from app.schemas import MissionCreate
from app.security.access import AccessRules, HostList
from app.security.gate import Gate
from app.security.rates import Rates
from app.security.sessions import SessionBook
from app.security.tokens import tokens_of
from app.server import server_of
from app.settings import Settings, static_root
from app.storage.audit import AuditStore
from app.storage.data_dir import DataDirLock
from app.storage.database import Database
from app.storage.logins import LoginStore
from app.storage.missions import MissionStore
from app.storage.presets import PresetStore
from app.storage.space import Space
from app.streams import Streams
from app.viewer.scenes import Scenes


def create_app(settings: Settings, *, runner: str = DEFAULT_RUNNER) -> FastAPI:
    """The service as an ASGI application. `runner` is what a mission process calls (see `MissionService`).

    Raises `ConfigError` for settings that would leave it open, and when its data are in use or unusable.
    """
    tokens = tokens_of(settings)
    with ExitStack() as held:
        recent_logs = RecentLogs()
        held.enter_context(recent_logs.listening())
        lock = DataDirLock(settings.data_dir)
        held.callback(lock.release)
        metrics = Metrics()
        database = Database(settings.database, on_error=metrics.storage_error)
        database.open()
        held.callback(database.close)
        sessions = SessionBook(tokens, LoginStore(database), lifetime_s=settings.access.session_s)
        store, audit = MissionStore(database), AuditStore(database)
        service = MissionService(settings, store, runner=runner)
        space = Space(settings.missions_dir)
        retention = Retention(
            settings.retention, service, store, audit, space, on_removed=metrics.files_removed
        )
        metrics.watch(service, store, space)
        catalogue = Catalogue(settings.scenes_dir, PresetStore(database))
        rules, rates = AccessRules(tokens, sessions, settings.access), Rates(settings.limits)
        scenes_3d = Scenes(settings.display) if settings.viewer else None
        # What fails above lets go of it all; from here on the end of the application does.
        release = held.pop_all()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        if scenes_3d is not None:
            service.add_view_listener(scenes_3d.show)
        service.add_event_listener(metrics.mission_event)
        service.add_drop_listener(metrics.telemetry_dropped)
        service.add_end_listener(metrics.mission_ended)
        service.add_end_listener(lambda _: retention.look_soon())
        service.ask_for_room(retention.make_room)
        await run_in_threadpool(service.begin)
        retention.begin()
        if settings.demo:
            await run_in_threadpool(_start_demo, service, catalogue, settings)
        yield
        await run_in_threadpool(service.shutdown)
        await run_in_threadpool(retention.close)
        if scenes_3d is not None:
            await run_in_threadpool(scenes_3d.close)
        release.close()

    app = FastAPI(title="hgs", version=version("hgs"), lifespan=lifespan, docs_url=None, redoc_url=None)
    app.state.settings = settings
    app.state.database = database
    app.state.service = service
    app.state.catalogue = catalogue
    app.state.scenes = scenes_3d
    app.state.tokens = tokens
    app.state.sessions = sessions
    app.state.rules = rules
    app.state.rates = rates
    app.state.audit = audit
    app.state.streams = Streams(on_skipped=metrics.telemetry_skipped)
    app.state.metrics = metrics
    app.state.space = space
    app.state.recent_logs = recent_logs
    app.state.stop_threads = CapacityLimiter(8)
    install_error_handlers(app)
    install_openapi(app)
    api = APIRouter(prefix=API_PREFIX)
    for module in (
        session,
        scenes,
        missions,
        plans,
        ingest,
        events,
        images,
        moments,
        results,
        bundle,
        system,
    ):
        api.include_router(module.router)
    app.include_router(api)
    app.include_router(system.health_router)
    app.include_router(viewer.router)
    app.mount("/", StaticFiles(directory=static_root(), html=True), name="operator page")
    hosts = HostList(settings.host, settings.access.allowed_hosts)
    app.add_middleware(Gate, hosts=hosts, rules=rules, rates=rates, audit=audit, limits=settings.limits)
    app.add_middleware(Requests, metrics=metrics)
    return app


def serve(settings: Settings) -> None:
    """Serve until SIGINT or SIGTERM. Raises `ConfigError` as `create_app` does, and `OSError` for an address
    that cannot be listened on.
    """
    configure_logging(settings.logs.style, settings.logs.level, process="service")
    app = create_app(settings)
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    with socket.create_server((settings.host, settings.port), family=family) as listener:
        server_of(app, settings, end_streams=app.state.streams.end).run(sockets=[listener])


def _start_demo(service: MissionService, catalogue: Catalogue, settings: Settings) -> None:
    order = catalogue.order(MissionCreate(scene="house", preset=settings.demo_preset))
    mission, _ = service.create(order)
    service.start(mission.id)
