"""The service on a real port, served as `hgs serve` does."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from fastapi import FastAPI

from app.main import create_app
from app.missions.service import DEFAULT_RUNNER, MissionService
from app.server import server_of
from app.settings import Settings


@dataclass(frozen=True, kw_only=True)
class LiveService:
    port: int
    app: FastAPI

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    @property
    def missions(self) -> MissionService:
        return self.app.state.service


@contextmanager
def serving(settings: Settings, *, runner: str = DEFAULT_RUNNER) -> Iterator[LiveService]:
    """Serve at a free port of the loopback address until the block ends."""
    listener = socket.create_server(("127.0.0.1", 0))
    port = listener.getsockname()[1]
    app = create_app(settings.model_copy(update={"port": port}), runner=runner)
    server = server_of(app, settings, end_streams=app.state.streams.end)
    thread = threading.Thread(target=server.run, args=([listener],), daemon=True)
    thread.start()
    while not server.started:
        assert thread.is_alive(), "the service did not start"
        time.sleep(0.02)
    try:
        yield LiveService(port=port, app=app)
    finally:
        server.should_exit = True
        thread.join(60)
        assert not thread.is_alive(), "the service did not stop"
