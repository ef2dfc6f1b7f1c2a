import psutil
import pytest
from starlette.websockets import WebSocketDisconnect

from tests.app.conftest import begin, create, wait_for, wait_until

PROBLEM = "application/problem+json"
WS = "ws://127.0.0.1"


def test_a_mission_runs_to_its_end_and_leaves_results(service):
    client = service("run_short")
    mission = begin(client, seed=3)
    found = wait_for(client, mission, "completed")
    assert found["stop_reason"] == "complete"
    assert found["reason"] == "nothing worth seeing is left"
    assert found["figures"]["frame"] == 19
    assert found["commands"] == []
    names = [entry["name"] for entry in client.get(f"/api/v1/missions/{mission}/results").json()]
    assert names == ["report.json", "trajectory.txt", "process.log"]
    report = client.get(f"/api/v1/missions/{mission}/results/report.json")
    assert report.json() == {
        "scene": "house",
        "seed": 3,
        "clock": None,
        "stop_reason": "complete",
        "frames": 20,
    }
    assert mission in report.headers["content-disposition"]


def test_watch_pause_resume_and_stop_over_the_websocket(service):
    client = service("run_long")
    mission = begin(client)
    path = f"/api/v1/missions/{mission}"
    with client.websocket_connect(f"{WS}{path}/events") as events:
        seen = []

        def until(match):
            while True:
                event = events.receive_json()
                if event["kind"] != "alive":
                    seen.append(event)
                if match(event):
                    return event

        until(lambda e: e["kind"] == "state" and e["state"] == "running")
        frame = until(lambda e: e["kind"] == "telemetry")["frame"]
        assert until(lambda e: e["kind"] == "telemetry")["frame"] > frame
        plan = until(lambda e: e["kind"] == "plan")
        assert {"yaw_deg", "coverage", "quality", "total", "status"} <= set(plan["candidates"][0])
        assert "yaw_rad" not in plan["candidates"][0]

        assert client.post(f"{path}/pause").status_code == 202
        until(lambda e: e["kind"] == "state" and e["state"] == "paused")
        paused = client.get(path).json()
        assert paused["commands"] == ["resume", "stop"]
        assert client.post(f"{path}/pause").status_code == 409

        assert client.post(f"{path}/resume").status_code == 202
        until(lambda e: e["kind"] == "state" and e["state"] == "running")
        until(lambda e: e["kind"] == "telemetry")

        assert client.post(f"{path}/stop").status_code == 202
        assert client.post(f"{path}/stop").status_code == 202
        until(lambda e: e["kind"] == "ended")
        until(lambda e: e["kind"] == "state" and e["state"] == "aborted")
    assert [e["sequence"] for e in seen] == sorted({e["sequence"] for e in seen})
    states = [e["state"] for e in seen if e["kind"] == "state"]
    assert states == ["starting", "running", "paused", "running", "stopping", "aborted"]
    found = client.get(path).json()
    assert found["stop_reason"] == "interrupted"
    assert client.get(f"{path}/results/report.json").json()["stop_reason"] == "interrupted"
    assert client.post(f"{path}/stop").status_code == 202
    assert client.get(path).json()["state"] == "aborted"


def test_a_stream_goes_on_where_the_reader_left_it(service):
    client = service("run_short")
    mission = begin(client)
    last = wait_for(client, mission, "completed")["last_sequence"]
    history = client.get(f"/api/v1/missions/{mission}/events", params={"limit": 5000}).json()
    assert not history["more"]
    assert [e["sequence"] for e in history["events"]] == list(range(1, last + 1))
    with client.websocket_connect(f"{WS}/api/v1/missions/{mission}/events?after={last - 3}") as events:
        assert [events.receive_json()["sequence"] for _ in range(3)] == [last - 2, last - 1, last]
    newest = client.get(
        f"/api/v1/missions/{mission}/events", params={"newest": True, "limit": 2, "kind": ["state", "plan"]}
    ).json()
    assert newest["more"]
    assert [e["kind"] for e in newest["events"]] == ["state", "state"]
    first = client.get(f"/api/v1/missions/{mission}/events", params={"limit": 1}).json()
    assert first["more"]
    assert first["events"][0]["sequence"] == 1


def test_metrics_hold_every_frame_and_can_be_thinned_and_continued(service):
    client = service("run_short")
    mission = begin(client)
    wait_for(client, mission, "completed")
    path = f"/api/v1/missions/{mission}/metrics"
    page = client.get(path).json()
    columns = page["columns"]
    assert len(columns["time_s"]) == 20
    assert columns["psnr_current_db"][0] is None  # NaN has no JSON
    assert columns["psnr_current_db"][1] is not None
    assert columns["time_s"] == sorted(columns["time_s"])
    assert page["plans"]["time_s"] == columns["time_s"][::5]  # the fake mission plans every fifth frame
    assert page["plans"]["planning_s"] == pytest.approx([0.035] * 4)
    thin = client.get(path, params={"limit": 5}).json()["columns"]["time_s"]
    assert len(thin) == 5
    assert (thin[0], thin[-1]) == (columns["time_s"][0], columns["time_s"][-1])
    assert client.get(path, params={"since": page["next_since"]}).json() == {
        "columns": {name: [] for name in columns},
        "plans": {name: [] for name in page["plans"]},
        "next_since": page["next_since"],
    }


def test_commands_that_make_no_sense_are_refused_with_the_reason(service):
    client = service()
    mission = create(client)
    for command in ("pause", "resume"):
        refused = client.post(f"/api/v1/missions/{mission}/{command}")
        assert refused.status_code == 409
        assert refused.headers["content-type"] == PROBLEM
        problem = refused.json()
        assert problem["status"] == 409
        assert "created" in problem["detail"]
        assert problem["instance"].endswith(command)
    assert client.post(f"/api/v1/missions/{mission}/stop").status_code == 202
    assert client.get(f"/api/v1/missions/{mission}").json()["state"] == "aborted"
    assert client.post(f"/api/v1/missions/{mission}/start").status_code == 409


def test_unknown_things_are_problems_too(service):
    client = service()
    for path in (
        "/api/v1/missions/nothing",
        "/api/v1/missions/nothing/results",
        "/api/v1/missions/nothing/images/depth",
        "/api/v1/nothing",
        "/nothing.html",
    ):
        answer = client.get(path)
        assert answer.status_code == 404, path
        assert answer.headers["content-type"] == PROBLEM
        assert answer.json()["status"] == 404
    assert client.post("/api/v1/missions/nothing/start").status_code == 404
    assert client.delete("/api/v1/missions").status_code == 405
    with (
        pytest.raises(WebSocketDisconnect) as closed,
        client.websocket_connect(f"{WS}/api/v1/missions/nothing/events") as events,
    ):
        events.receive_json()
    assert closed.value.code == 4404


@pytest.mark.parametrize(
    ("wish", "field", "mentions"),
    [
        ({"scene": "castle"}, "scene", "house"),
        ({"scene": "../../etc/passwd"}, "scene", "house"),
        ({"scene": "house:x"}, "scene", "house"),
        ({"preset": "fast"}, "preset", "quick"),
        ({"seed": -1}, "seed", "greater than or equal to 0"),
        ({"clock": "sundial"}, "clock", "'lockstep' or 'real'"),
        ({"max_time_s": 0}, "max_time_s", "greater than 0"),
        ({"colour": "red"}, "colour", "not permitted"),
        ({"overrides": {"mapping.nothing": "3"}}, "overrides", "nothing"),
        ({"overrides": {"limits.max_time_s": "-3"}}, "overrides", "-3"),
        ({"overrides": {"a b": "3"}}, "overrides", "pattern"),
    ],
)
def test_a_wish_that_cannot_be_met_names_field_value_and_what_is_allowed(service, wish, field, mentions):
    client = service()
    answer = client.post("/api/v1/missions", json={"preset": "quick", **wish})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == PROBLEM
    entry = answer.json()["errors"][0]
    assert entry["field"].startswith(field)
    assert "value" in entry
    assert mentions in entry["message"]
    assert client.get("/api/v1/missions").json()["missions"] == []


@pytest.mark.parametrize("clock", [None, "lockstep", "real"])
def test_the_mission_runs_by_the_clock_that_was_chosen(service, clock):
    client = service("run_short")
    created = client.post("/api/v1/missions", json={"preset": "quick", "clock": clock})
    assert created.json()["clock"] == clock
    mission = created.json()["id"]
    client.post(f"/api/v1/missions/{mission}/start")
    wait_for(client, mission, "completed")
    report = client.get(f"/api/v1/missions/{mission}/results/report.json").json()
    assert report["clock"] == clock


def test_a_repeated_request_makes_one_mission(service):
    client = service()
    wish = {"scene": "house:2", "preset": "quick", "seed": 5}
    first = client.post("/api/v1/missions", json=wish, headers={"Idempotency-Key": "k1"})
    again = client.post("/api/v1/missions", json=wish, headers={"Idempotency-Key": "k1"})
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json()["id"] == again.json()["id"]
    assert first.headers["location"] == f"/api/v1/missions/{first.json()['id']}"
    other = client.post("/api/v1/missions", json={**wish, "seed": 6}, headers={"Idempotency-Key": "k1"})
    assert other.status_code == 409
    assert len(client.get("/api/v1/missions").json()["missions"]) == 1


def test_an_error_of_the_mission_fails_it_in_its_own_words(service):
    client = service("run_failing")
    mission = begin(client)
    found = wait_for(client, mission, "failed")
    assert found["reason"] == "the fake room has no free floor"
    log = client.get(f"/api/v1/missions/{mission}/results/process.log").text
    assert "SceneError" in log


def test_a_process_that_vanishes_interrupts_its_mission_and_the_service_lives_on(service):
    client = service("run_vanishing")
    mission = begin(client)
    assert "exit code 7" in wait_for(client, mission, "interrupted")["reason"]
    assert client.get("/healthz").json() == {"status": "ok"}
    second = begin(client)
    wait_for(client, second, "interrupted")


def test_a_process_that_ignores_stop_is_ended_by_force(service, impatient):
    client = service("run_deaf", supervision=impatient)
    mission = begin(client)
    wait_for(client, mission, "running")
    pid = client.app.state.service.get(mission).pid
    client.post(f"/api/v1/missions/{mission}/stop")
    found = wait_for(client, mission, "aborted")
    assert "by force" in found["reason"]
    assert "STOP" in found["reason"]
    wait_until(lambda: not psutil.pid_exists(pid))
