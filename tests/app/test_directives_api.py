"""What an operator asks of missions over REST: kept, passed on, taken, told."""

import json

import pytest

from hgs_core.planning.directives import Directives
from tests.app.conftest import begin, create, wait_for, wait_until

NOTHING = Directives().model_dump(mode="json")
TRIANGLE = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]
MUCH = {
    "region": [[0.5, 0.5], [6.0, 0.5], [6.0, 4.0], [0.5, 4.0]],
    "no_go": [TRIANGLE],
    "max_speed_m_s": 0.4,
    "max_path_m": 60.0,
    "return_to_start": True,
    "approve_views": False,
}


def directives(client, mission):
    return client.get(f"/api/v1/missions/{mission}/directives").json()


def events(client, mission, kind):
    page = client.get(f"/api/v1/missions/{mission}/events", params={"kind": kind}).json()
    return page["events"]


def test_a_mission_begins_with_what_was_asked_of_it(service):
    client = service("run_long")
    plain, asked = create(client), create(client, directives=MUCH)
    assert directives(client, plain) == NOTHING
    assert directives(client, asked) == MUCH
    found = client.get(f"/api/v1/missions/{asked}").json()
    assert found["directives"] == MUCH
    assert found["overrides"] == {}
    assert found["approval"] is None


def test_what_the_settings_ask_counts_where_the_order_says_nothing(service):
    client = service("run_long")
    mission = create(client, overrides={"directives.max_path_m": "30", "limits.max_time_s": "60"})
    assert directives(client, mission) == {**NOTHING, "max_path_m": 30.0}
    assert client.get(f"/api/v1/missions/{mission}").json()["overrides"] == {"limits.max_time_s": "60"}


def test_before_the_start_they_are_replaced_whole_and_told(service):
    client = service("run_long")
    mission = create(client, directives=MUCH)
    answer = client.put(f"/api/v1/missions/{mission}/directives", json={"max_path_m": 10})
    assert answer.status_code == 200
    assert answer.json() == directives(client, mission) == {**NOTHING, "max_path_m": 10.0}
    (told,) = events(client, mission, "directives")
    assert told["directives"] == answer.json()


def test_a_running_mission_takes_them_and_keeps_them_over_its_end(service):
    client = service("run_long")
    mission = begin(client)
    wait_for(client, mission, "running")
    assert client.put(f"/api/v1/missions/{mission}/directives", json=MUCH).json() == MUCH
    wait_until(lambda: events(client, mission, "directives"))
    assert events(client, mission, "directives")[-1]["directives"] == MUCH
    client.post(f"/api/v1/missions/{mission}/stop")
    wait_for(client, mission, "aborted")
    assert directives(client, mission) == MUCH
    refused = client.put(f"/api/v1/missions/{mission}/directives", json=NOTHING)
    assert refused.status_code == 409


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("max_speed_m_s", True, "number"),
        ("max_path_m", "10", "number"),
        ("max_path_m", 0, "greater than 0"),
        ("return_to_start", 1, "boolean"),
        ("region", [[0, 0], [1, 1]], "at least 3"),
        ("region", [[0, 0], [1, 0], ["2", 3]], "number"),
        ("region", [[0, 0], [2, 2], [2, 0], [0, 2]], "crosses itself"),
        ("region", [[0, 0], [1, 1], [2, 2]], "encloses"),
        ("no_go", [TRIANGLE] * 33, "at most 32"),
        ("no_go", [[[0, 0], [1, 0], [1, 2e6]]], "less than or equal"),
        ("speed", 1, "not permitted"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_field(service, field, value, says):
    client = service("run_long")
    mission = create(client)
    answer = client.put(f"/api/v1/missions/{mission}/directives", json={field: value})
    assert answer.status_code == 422
    assert any(field in error["field"] for error in answer.json()["errors"])
    assert says in json.dumps(answer.json())
    assert directives(client, mission) == NOTHING


def test_views_wait_for_the_operators_word(service):
    client = service("run_long")
    mission = begin(client, directives={"approve_views": True})
    wait_until(lambda: client.get(f"/api/v1/missions/{mission}").json()["phase"] == "awaiting_approval")
    found = client.get(f"/api/v1/missions/{mission}").json()
    assert (found["state"], found["phase"]) == ("running", "awaiting_approval")
    assert found["reason"] == "waits for the operator to approve plan 1"
    assert found["approval"]["plan_sequence"] == 1
    assert found["approval"]["view"]["yaw_deg"] == pytest.approx(28.6, abs=0.1)
    plan = client.get(f"/api/v1/missions/{mission}/plan").json()
    assert (plan["plan_sequence"], plan["sequence"]) == (1, found["newest_plan"])
    assert all("why" in c for c in plan["candidates"] if c["status"] != "selected")

    url = f"/api/v1/missions/{mission}/approval"
    assert client.post(url, json={"plan_sequence": 2, "decision": "approve"}).status_code == 409
    unknown = client.post(url, json={"plan_sequence": 1, "decision": "approve", "candidate": 12})
    assert unknown.status_code == 422
    assert unknown.json()["errors"][0]["allowed"] == "0 to 11"
    both = client.post(url, json={"plan_sequence": 1, "decision": "reject", "candidate": 3})
    assert both.status_code == 422

    assert client.post(url, json={"plan_sequence": 1, "decision": "approve"}).status_code == 202
    wait_until(lambda: len(events(client, mission, "approval")) >= 3)
    states = [(e["plan_sequence"], e["state"]) for e in events(client, mission, "approval")[:3]]
    assert states == [(1, "waiting"), (1, "approved"), (2, "waiting")]
    assert client.post(url, json={"plan_sequence": 1, "decision": "approve"}).status_code == 409
    client.post(f"/api/v1/missions/{mission}/stop")
    wait_for(client, mission, "aborted")
    assert client.post(url, json={"plan_sequence": 2, "decision": "approve"}).status_code == 409
