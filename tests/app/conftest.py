import tempfile
import time
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings, SupervisionSettings
from app.storage.database import Database
from app.storage.missions import MissionStore
from tests.app.databases import fresh_database, postgres_programs, private_postgres
from tests.app.fake_mission import runner

PATIENCE_S = 90.0
"""A spawned process imports torch first, and the machine may be busy."""


@pytest.fixture
def service(tmp_path):
    """Start the service around one of the fake runners: `service("run_short")`. Stopped after the test.

    Called again, it ends the service that runs and starts another on the same data.
    """
    clients = []

    def begin(runner_name: str = "run_long", **changes) -> TestClient:
        while clients:
            clients.pop().__exit__(None, None, None)
        given = {"data_dir": tmp_path / "data", "viewer": False, "mission_threads": 1, **changes}
        client = TestClient(
            create_app(Settings(**given), runner=runner(runner_name)),
            base_url="http://127.0.0.1",
            raise_server_exceptions=False,
        )
        client.__enter__()
        clients.append(client)
        return client

    yield begin
    for client in clients:
        client.__exit__(None, None, None)


@pytest.fixture(scope="session")
def postgres():
    """A PostgreSQL server of the tests' own; they are skipped where none is installed."""
    programs = postgres_programs()
    if programs is None:
        pytest.skip("no PostgreSQL on this machine: install the distribution's package `postgresql`")
    # Not below tmp_path, which only the user of the tests may enter; short, because a socket lies in it.
    with tempfile.TemporaryDirectory(prefix="hgs-pg-") as folder:
        Path(folder).chmod(0o755)
        with private_postgres(programs, Path(folder) / "cluster") as url:
            yield url


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request, tmp_path):
    """An empty database of each kind that the service supports."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'hgs.db'}"
    return fresh_database(request.getfixturevalue("postgres"))


@pytest.fixture
def database(database_url):
    database = Database(database_url)
    database.open()
    yield database
    database.close()


@pytest.fixture
def store(database):
    return MissionStore(database)


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
