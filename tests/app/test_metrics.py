"""What Prometheus is told, and whom it is told."""

import httpx
import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from websockets.sync.client import connect

from app.main import create_app
from app.missions.states import MissionState
from app.settings import AccessSettings, Settings
from app.storage.database import StorageError
from tests.app.conftest import begin, create, wait_for, wait_until
from tests.app.fake_mission import runner
from tests.app.live_service import serving

OPERATOR = "the operator's token, long enough"
VIEWER = "the viewer's token, long enough"


def measured(client) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    """Every sample by name and labels."""
    answer = client.get("/metrics")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def value(samples, name: str, **labels: str) -> float:
    return samples[name, tuple(sorted(labels.items()))]


def named(samples, name: str) -> dict:
    return {labels: number for (found, labels), number in samples.items() if found == name}


def test_missions_are_counted_and_those_that_run_are_shown_each(service):
    client = service("run_long")
    create(client)
    running = begin(client)
    wait_for(client, running, "running")
    queued = begin(client)
    wait_until(lambda: client.get(f"/api/v1/missions/{running}").json()["figures"] is not None)
    samples = measured(client)
    states = {dict(labels)["state"]: number for labels, number in named(samples, "hgs_missions").items()}
    assert set(states) == set(MissionState)
    assert (states["created"], states["running"], states["queued"]) == (1, 1, 1)
    assert value(samples, "hgs_missions_queued") == 1
    assert value(samples, "hgs_mission_gaussians", mission=running) > 0
    assert value(samples, "hgs_mission_resident_bytes", mission=running) > 2**20
    assert value(samples, "hgs_mission_silent_seconds", mission=running) >= 0
    # Events are saved in batches, a moment after they come.
    wait_until(lambda: value(measured(client), "hgs_mission_events_unsaved", mission=running) == 0)
    # Labels of missions are those of running ones: a service that has run thousands tells no more.
    client.post(f"/api/v1/missions/{queued}/stop")
    client.post(f"/api/v1/missions/{running}/stop")
    wait_for(client, running, "aborted")
    samples = measured(client)
    assert not any("mission" in dict(labels) for _, labels in samples)
    assert client.app.state.metrics._last_wall_s == {}


def test_what_a_mission_does_again_and_again_is_measured(service):
    client = service("run_short")
    mission = begin(client)
    wait_for(client, mission, "completed")
    samples = measured(client)
    assert value(samples, "hgs_mapping_seconds_count") == 20
    assert value(samples, "hgs_mapping_seconds_sum") == pytest.approx(20 * 0.018)
    assert value(samples, "hgs_frame_seconds_count") == 19
    parts = {"total": 0.035, "viewpoint_evaluation": 0.02, "local": 0.01, "global": 0.005}
    for part, seconds in parts.items():
        assert value(samples, "hgs_planning_seconds_count", part=part) == 4
        assert value(samples, "hgs_planning_seconds_sum", part=part) == pytest.approx(4 * seconds)


def test_requests_are_measured_by_route_whatever_is_asked_for(service):
    client = service("run_long")
    mission = create(client)
    for _ in range(3):
        client.get(f"/api/v1/missions/{mission}")
    client.get("/api/v1/missions/no-such-mission")
    client.get("/")
    for number in range(20):
        client.get(f"/nothing/{number}")
        client.request(f"WORD{number}", "/api/v1/missions")
    samples = measured(client)
    counts = {tuple(dict(k).values()): n for k, n in named(samples, "hgs_http_request_seconds_count").items()}
    route = "/api/v1/missions/{mission_id}"
    assert value(samples, "hgs_http_request_seconds_count", method="GET", route=route, status="200") == 3
    assert value(samples, "hgs_http_request_seconds_count", method="GET", route=route, status="404") == 1
    assert value(samples, "hgs_http_request_seconds_count", method="GET", route="page", status="200") == 1
    assert value(samples, "hgs_http_request_seconds_count", method="GET", route="page", status="404") == 20
    assert {method for method, *_ in counts} <= {"GET", "POST", "other"}
    assert len(counts) < 15


def test_streams_the_disk_the_process_and_failures_of_the_database_are_told(service):
    client = service("run_long")
    mission = begin(client)
    wait_for(client, mission, "running")
    with client.websocket_connect(f"ws://127.0.0.1/api/v1/missions/{mission}/events") as events:
        events.receive_json()
        samples = measured(client)
        assert value(samples, "hgs_stream_subscribers", kind="websocket") == 1
    wait_until(lambda: value(measured(client), "hgs_stream_subscribers", kind="websocket") == 0)
    database = client.app.state.database
    with pytest.raises(StorageError), database.transaction() as session:
        session.connection().exec_driver_sql("SELECT * FROM nothing")
    samples = measured(client)
    assert value(samples, "hgs_database_errors_total") == 1
    assert value(samples, "hgs_disk_size_bytes") >= value(samples, "hgs_disk_free_bytes") > 0
    assert value(samples, "process_resident_memory_bytes") > 2**20
    assert value(samples, "process_open_fds") > 3
    assert "hgs_stream_telemetry_skipped_total" in {name for name, _ in samples}


def test_telemetry_that_a_slow_reader_misses_is_counted(service):
    client = service("run_long")
    mission = create(client)
    log = client.app.state.service.get(mission).log
    client.portal.call(_read_a_little, client.app.state.streams, client.app.state.service.get(mission), log)
    assert value(measured(client), "hgs_stream_telemetry_skipped_total") == 80


async def _read_a_little(streams, mission, log) -> None:
    reader = streams.follow(mission, 0, allowed=lambda: True)
    log.append({"kind": "notice", "level": "info", "message": "hello"})
    assert (await anext(reader))["kind"] == "notice"
    for number in range(100):
        log.append({"kind": "telemetry", "frame": number})
    assert (await anext(reader))["frame"] == 80
    await reader.aclose()


@pytest.mark.parametrize(
    ("open_metrics", "token", "status"),
    [
        (False, None, 401),
        (False, VIEWER, 200),
        (False, OPERATOR, 200),
        (False, "a guess of somebody", 401),
        (True, None, 200),
        (True, "a guess of somebody", 401),
    ],
)
def test_measurements_are_for_those_who_may_look(tmp_path, open_metrics, token, status):
    access = AccessSettings(operator_token=OPERATOR, viewer_token=VIEWER, open_metrics=open_metrics)
    settings = Settings(data_dir=tmp_path, viewer=False, access=access)
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    with serving(settings, runner=runner("run_short")) as live:
        assert httpx.get(f"{live.url}metrics", headers=headers).status_code == status
    app = create_app(settings, runner=runner("run_short"))
    with TestClient(app, base_url="http://127.0.0.1", client=("192.0.2.1", 1)) as elsewhere:
        # From another machine they need a token whatever the setting.
        expected = 401 if token is None else status
        assert elsewhere.get("/metrics", headers=headers).status_code == expected


def test_what_opens_while_readers_come_and_go_adds_up_to_nothing(tmp_path):
    settings = Settings(data_dir=tmp_path, viewer=False, mission_threads=1)
    with serving(settings, runner=runner("run_long")) as live, httpx.Client(base_url=live.url) as client:
        mission = client.post("api/v1/missions", json={"preset": "quick"}).json()["id"]
        path = f"api/v1/missions/{mission}/events"
        for _ in range(3):
            socket = connect(f"{live.url}{path}".replace("http", "ws", 1))
            with socket, client.stream("GET", f"{path}/stream"):
                wait_until(lambda: _open(client) == 2)
        wait_until(lambda: _open(client) == 0)


def _open(client) -> float:
    return sum(named(measured(client), "hgs_stream_subscribers").values())
