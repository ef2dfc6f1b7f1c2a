"""Missions whose process, service or both ended under them: nothing told is lost, and they can be resumed."""

import json
import os
import signal

import psutil
import pytest

from app.missions.states import MissionState
from tests.app.conftest import begin, create, wait_for, wait_until


def wait_for_frame(client, mission: str, frame: int) -> None:
    wait_until(
        lambda: (client.get(f"/api/v1/missions/{mission}").json()["figures"] or {}).get("frame", 0) >= frame
    )


def kill(client, mission: str) -> None:
    """Kill the mission's process while it runs."""
    wait_for_frame(client, mission, 15)
    os.kill(client.app.state.service.get(mission).pid, signal.SIGKILL)


def events_of(client, mission: str, **query) -> list[dict]:
    answer = client.get(f"/api/v1/missions/{mission}/events", params={"limit": 5000, **query})
    return answer.json()["events"]


def resume(client, mission: str):
    return client.post(f"/api/v1/missions/{mission}/resume")


def test_a_killed_mission_is_interrupted_and_resumed_without_gap_or_repetition(service):
    client = service("run_slowly")
    mission = begin(client)
    kill(client, mission)
    found = wait_for(client, mission, "interrupted")
    assert "SIGKILL" in found["reason"]
    assert found["commands"] == ["resume", "stop"]
    assert (found["stop_reason"], found["ended_at"]) == ("interrupted", None)
    told = events_of(client, mission)
    shown = found["view_sequence"]
    assert told[-1]["state"] == "interrupted"

    assert resume(client, mission).status_code == 202
    wait_for_frame(client, mission, found["figures"]["frame"] + 5)
    again = events_of(client, mission)
    assert again[: len(told)] == told
    assert [e["sequence"] for e in again] == list(range(1, len(again) + 1))
    (resumed,) = [e for e in again if e["kind"] == "resumed"]
    frames = [e for e in again if e["kind"] == "telemetry"]
    assert [e["frame"] for e in frames] == list(range(len(frames)))
    assert resumed["time_s"] < found["figures"]["time_s"]
    plans = [e["time_s"] for e in again if e["kind"] == "plan"]
    assert plans == sorted(set(plans))
    assert [e["message"] for e in again if e["kind"] == "notice"] == ["a fake chair is in the way"]
    now = client.get(f"/api/v1/missions/{mission}").json()
    assert (now["state"], now["stop_reason"]) == ("running", None)
    assert now["view_sequence"] >= shown
    client.post(f"/api/v1/missions/{mission}/stop")
    assert wait_for(client, mission, "aborted")["stop_reason"] == "interrupted"


def test_what_a_mission_told_when_no_service_listened_is_told_later(service):
    client = service("run_slowly")
    mission = begin(client)
    kill(client, mission)
    wait_for(client, mission, "interrupted")
    partial = client.app.state.service.get(mission).results_dir.with_name("run.partial")
    *_, last = (
        event
        for line in (partial / "events.jsonl").read_text().splitlines()
        if (event := json.loads(line))["kind"] == "telemetry"
    )
    with (partial / "events.jsonl").open("a") as file:
        for more in (1, 2, 3):
            told = {**last, "frame": last["frame"] + more, "time_s": last["time_s"] + 0.4 * more}
            file.write(json.dumps(told) + "\n")
        file.write('{"kind": "tele')
    (partial / "saved.json").write_text(json.dumps(last["frame"] + 4))
    resume(client, mission)
    wait_for_frame(client, mission, last["frame"] + 6)
    client.post(f"/api/v1/missions/{mission}/stop")
    events = events_of(client, mission)
    frames = [e["frame"] for e in events if e["kind"] == "telemetry"]
    assert frames == list(range(len(frames)))
    assert [e["sequence"] for e in events] == list(range(1, len(events) + 1))


def test_what_ran_when_the_service_died_is_interrupted_unless_it_had_come_to_its_end(service):
    client = service("run_short")
    ended, lost = begin(client), create(client)
    wait_for(client, ended, "completed")
    store = client.app.state.service._store
    for mission in (ended, lost):
        record = client.app.state.service.get(mission).record
        changes = {"state": MissionState.RUNNING, "stop_reason": None, "started_at": 1.0}
        store.save([], record.model_copy(update=changes), mission)
    again = service("run_short")
    found = {m["id"]: m for m in again.get("/api/v1/missions").json()["missions"]}
    assert (found[ended]["state"], found[ended]["stop_reason"]) == ("completed", "complete")
    assert (found[lost]["state"], found[lost]["stop_reason"]) == ("interrupted", "interrupted")
    assert found[lost]["reason"] == "the service ended while the mission was running"
    assert again.get(f"/api/v1/missions/{ended}/metrics").json()["columns"]["time_s"][-1] > 0
    assert resume(again, lost).status_code == 202
    wait_for(again, lost, "completed")


@pytest.mark.parametrize("resumes", [False, True])
def test_a_service_that_is_closed_suspends_its_mission_for_the_next_one(service, resumes):
    client = service("run_slowly")
    mission = begin(client)
    wait_for_frame(client, mission, 3)
    pid = client.app.state.service.get(mission).pid
    client.app.state.service.shutdown()
    assert not psutil.pid_exists(pid)
    found = client.get(f"/api/v1/missions/{mission}").json()
    assert (found["state"], found["reason"]) == ("interrupted", "suspended: saved")
    told = events_of(client, mission, kind="state")
    assert [e["state"] for e in told] == ["starting", "running", "stopping", "interrupted"]
    again = service("run_slowly", resume_on_start=resumes)
    if resumes:
        wait_for(again, mission, "running")
        again.post(f"/api/v1/missions/{mission}/stop")
    else:
        assert again.get(f"/api/v1/missions/{mission}").json()["state"] == "interrupted"
        stopped = again.post(f"/api/v1/missions/{mission}/stop").json()
        assert (stopped["state"], stopped["stop_reason"]) == ("aborted", "interrupted")
        assert stopped["reason"] == "stopped by the operator after it was interrupted"


def test_interrupted_missions_queue_like_others(service):
    client = service("run_slowly")
    first = begin(client)
    kill(client, first)
    wait_for(client, first, "interrupted")
    assert client.post(f"/api/v1/missions/{first}/start").status_code == 409
    second = begin(client)
    assert resume(client, first).json()["state"] == "queued"
    assert client.get("/api/v1/missions").json()["queued"] == [first]
    client.post(f"/api/v1/missions/{second}/stop")
    wait_for(client, first, "running")
    client.post(f"/api/v1/missions/{first}/stop")
