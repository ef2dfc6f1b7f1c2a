"""`hgs serve` in a process of its own, as operators run it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

_PROGRAM = """
import sys
from app.main import serve
from app.settings import Settings
serve(Settings.model_validate_json(sys.argv[1]))
"""
_WITH_RUNNER = """
import sys
import app.main
from app.settings import Settings
created, runner = app.main.create_app, sys.argv[2]
app.main.create_app = lambda settings: created(settings, runner=runner)
app.main.serve(Settings.model_validate_json(sys.argv[1]))
"""
PATIENCE_S = 180.0


@dataclass(frozen=True, kw_only=True)
class Served:
    port: int
    process: subprocess.Popen[bytes]
    log_file: Path

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    @property
    def api(self) -> str:
        return f"{self.url}api/v1"

    @property
    def pid(self) -> int:
        return self.process.pid

    def log(self) -> str:
        return self.log_file.read_text(encoding="utf-8", errors="replace")

    def end(self, number: signal.Signals = signal.SIGTERM) -> float:
        """Ask it to end; how long that took [s]."""
        began = time.monotonic()
        self.process.send_signal(number)
        self.process.wait(PATIENCE_S)
        return time.monotonic() - began


@contextmanager
def served(
    data_dir: Path, *, runner: str | None = None, environment: Mapping[str, str] = {}, **settings: object
) -> Iterator[Served]:
    """Serve at a free port until the block ends. `runner` is what missions run instead of the real loop."""
    from app.settings import Settings

    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    content = Settings(data_dir=data_dir, port=port, **settings).model_dump_json()  # type: ignore[arg-type]
    program = [_PROGRAM, content] if runner is None else [_WITH_RUNNER, content, runner]
    log_file = data_dir.with_name(f"{data_dir.name}-service-{port}.log")
    with log_file.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-c", *program],
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd=Path(__file__).resolve().parents[2],
            env={**os.environ, **environment},
        )
    service = Served(port=port, process=process, log_file=log_file)
    try:
        deadline = time.monotonic() + PATIENCE_S
        while not _answers(service):
            assert process.poll() is None, service.log()
            assert time.monotonic() < deadline, service.log()
            time.sleep(0.1)
        yield service
    finally:
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _answers(service: Served) -> bool:
    try:
        return httpx.get(f"{service.url}healthz", timeout=5).status_code == 200
    except httpx.TransportError:
        return False
