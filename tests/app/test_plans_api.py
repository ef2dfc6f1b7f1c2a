"""The newest plan, and the small answer about a mission that says which one it is."""

from app.storage.missions import MissionStore
from tests.app.conftest import begin, create, wait_for, wait_until


def refuse(*_, **__):
    raise AssertionError("the database was asked")


def test_the_newest_plan_is_given_once(service):
    client = service("run_long")
    mission = begin(client)
    url = f"/api/v1/missions/{mission}"
    wait_until(lambda: client.get(url).json()["newest_plan"] is not None)
    client.post(f"{url}/stop")
    ended = wait_for(client, mission, "aborted")
    answer = client.get(f"{url}/plan")
    plan = answer.json()
    assert (plan["kind"], plan["sequence"]) == ("plan", ended["newest_plan"])
    assert len(plan["candidates"]) == plan["n_candidates"]
    history = client.get(f"{url}/events", params={"kind": "plan", "newest": True, "limit": 1}).json()
    assert history["events"] == [plan]
    tag = answer.headers["etag"]
    again = client.get(f"{url}/plan", headers={"If-None-Match": tag})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert client.get(f"{url}/plan", headers={"If-None-Match": '"another"'}).json() == plan


def test_before_the_first_plan_there_is_none(service):
    client = service("run_long")
    mission = create(client)
    assert client.get(f"/api/v1/missions/{mission}").json()["newest_plan"] is None
    answer = client.get(f"/api/v1/missions/{mission}/plan")
    assert (answer.status_code, answer.headers["content-type"]) == (404, "application/problem+json")
    assert client.get("/api/v1/missions/nothing/plan").status_code == 404


def test_what_a_running_mission_does_is_told_without_the_database(service, monkeypatch):
    """Whoever watches asks again and again; while the database is slow, too."""
    client = service("run_long")
    mission = begin(client)
    wait_for(client, mission, "running")
    for name in ("find", "events", "last_sequence"):
        monkeypatch.setattr(MissionStore, name, refuse)
    found = client.get(f"/api/v1/missions/{mission}").json()
    assert found["state"] == "running"
    assert found["approval"] is None
    monkeypatch.undo()
    client.post(f"/api/v1/missions/{mission}/stop")
    wait_for(client, mission, "aborted")
