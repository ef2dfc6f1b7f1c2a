"""The service's process ends when it is asked to, with whatever is open."""

import contextlib
import signal
import socket
import sqlite3
import threading

import httpx
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from app.settings import DisplaySettings
from tests.app.conftest import wait_until
from tests.app.fake_mission import runner
from tests.app.served import served


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_promptly_with_streams_of_every_kind_open(tmp_path, number):
    display = DisplaySettings(interval_s=0.05, max_splats=2_000)
    ended = []
    with (
        served(tmp_path / "data", runner=runner("run_short"), mission_threads=1, display=display) as service,
        httpx.Client(base_url=service.api, timeout=60) as client,
    ):
        mission = client.post("/missions", json={"preset": "quick"}).json()["id"]
        client.post(f"/missions/{mission}/start")
        wait_until(lambda: client.get(f"/missions/{mission}").json()["state"] == "completed")
        address = service.url.removeprefix("http")

        def follow(path: str, **options) -> None:
            with connect(f"ws{address}{path}", max_size=None, **options) as stream:
                with contextlib.suppress(ConnectionClosed):
                    for _ in stream:
                        pass
                ended.append(stream.close_code)

        def listen() -> None:
            with client.stream("GET", f"/missions/{mission}/events/stream") as answer:
                for _ in answer.iter_raw():
                    pass
            ended.append("sse")

        protocol = f"viser-v{viser.__version__}"
        tasks = [
            threading.Thread(target=listen),
            threading.Thread(target=follow, args=(f"api/v1/missions/{mission}/events",)),
            threading.Thread(target=follow, args=(f"viewer/{mission}",), kwargs={"subprotocols": [protocol]}),
        ]
        for task in tasks:
            task.start()
        # One that takes in nothing, and one that has not said what it wants.
        stalled = socket.create_connection(("127.0.0.1", service.port))
        stalled.sendall(
            f"GET /api/v1/missions/{mission}/events/stream HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
        )
        silent = socket.create_connection(("127.0.0.1", service.port))
        wait_until(lambda: _open_streams(service) == 4)
        service.end(number)
        for task in tasks:
            task.join(30)
        stalled.close()
        silent.close()
        assert service.process.returncode in (0, -number)
        assert len(ended) == 3
        assert set(ended) <= {"sse", 1001, 1012}
        # Nobody had to be cut off when the time was up that open connections are granted.
        assert "graceful shutdown exceeded" not in service.log()


def test_a_mission_that_runs_is_suspended_and_waits_for_the_next_service(tmp_path):
    with (
        served(tmp_path / "data", runner=runner("run_long"), viewer=False, mission_threads=1) as service,
        httpx.Client(base_url=service.api, timeout=60) as client,
    ):
        mission = client.post("/missions", json={"preset": "quick"}).json()["id"]
        client.post(f"/missions/{mission}/start")
        wait_until(lambda: client.get(f"/missions/{mission}").json()["state"] == "running")
        service.end()
        log = service.log()
    assert f"mission={mission}" in log
    with contextlib.closing(sqlite3.connect(tmp_path / "data" / "hgs.db")) as database:
        assert database.execute("SELECT id, state FROM mission").fetchall() == [(mission, "interrupted")]


def _open_streams(service) -> float:
    lines = httpx.get(f"{service.url}metrics", timeout=60).text.splitlines()
    return sum(float(line.split()[-1]) for line in lines if line.startswith("hgs_stream_subscribers{"))
