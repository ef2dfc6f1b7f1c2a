import time

import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings, SupervisionSettings
from tests.app.fake_mission import runner

PATIENCE_S = 90.0
"""A spawned process imports torch first, and the machine may be busy."""


@pytest.fixture
def service(tmp_path):
    """Start the service around one of the fake runners: `service("run_short")`. Stopped after the test."""
    clients = []

    def begin(runner_name: str = "run_long", **changes) -> TestClient:
        settings = Settings(data_dir=tmp_path / "data", viewer=False, mission_threads=1, **changes)
        client = TestClient(
            create_app(settings, runner=runner(runner_name)),
            base_url="http://127.0.0.1",
            raise_server_exceptions=False,
        )
        client.__enter__()
        clients.append(client)
        return client

    yield begin
    for client in clients:
        client.__exit__(None, None, None)


@pytest.fixture
def impatient():
    """Limits for tests of what happens when a process does not obey."""
    return SupervisionSettings(stop_acknowledged_s=1.0, terminate_s=2.0, shutdown_s=1.0)


def create(client: TestClient, **wish) -> str:
    answer = client.post("/api/v1/missions", json={"preset": "quick", **wish})
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def begin(client: TestClient, **wish) -> str:
    mission = create(client, **wish)
    assert client.post(f"/api/v1/missions/{mission}/start").status_code == 202
    return mission


def wait_for(client: TestClient, mission: str, *states: str) -> dict:
    """The mission once it is in one of `states`."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        found = client.get(f"/api/v1/missions/{mission}").json()
        if found["state"] in states:
            return found
        assert found["state"] not in ("completed", "failed", "aborted"), found
        assert time.monotonic() < deadline, f"still {found['state']}: {found['reason']}"
        time.sleep(0.05)


def wait_until(condition) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)
