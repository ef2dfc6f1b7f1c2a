"""Several missions: a stated number at once, the others in a queue that outlives the service."""

from app.missions.mission import Mission
from tests.app.conftest import begin, create, wait_for, wait_until


def start(client, mission: str) -> str:
    answer = client.post(f"/api/v1/missions/{mission}/start")
    assert answer.status_code == 202, answer.text
    return answer.json()["state"]


def ended(client, *missions: str) -> None:
    for mission in missions:
        client.post(f"/api/v1/missions/{mission}/stop")
    for mission in missions:
        wait_for(client, mission, "aborted")


def test_what_finds_no_free_place_waits_and_starts_in_order(service):
    client = service("run_long")
    first = begin(client)
    waiting = [create(client, seed=seed) for seed in (1, 2, 3)]
    assert [start(client, mission) for mission in waiting] == ["queued"] * 3
    found = client.get("/api/v1/missions").json()
    assert (found["running"], found["queued"], found["missions_at_once"]) == ([first], waiting, 1)
    detail = client.get(f"/api/v1/missions/{waiting[0]}").json()
    assert detail["commands"] == ["stop"]
    assert "1 mission runs at a time" in detail["reason"]
    for command in ("start", "pause", "resume"):
        refused = client.post(f"/api/v1/missions/{waiting[0]}/{command}")
        assert refused.status_code == 409
        assert "queued" in refused.json()["detail"]

    ended(client, first)
    wait_for(client, waiting[0], "running")
    assert client.get("/api/v1/missions").json()["queued"] == waiting[1:]
    # STOP takes one out of the middle of the queue, at once.
    assert client.post(f"/api/v1/missions/{waiting[1]}/stop").json()["state"] == "aborted"
    ended(client, waiting[0])
    wait_for(client, waiting[2], "running")
    ended(client, waiting[2])


def test_as_many_run_at_once_as_the_setting_says(service):
    client = service("run_long", missions_at_once=2)
    missions = [create(client, seed=seed) for seed in range(3)]
    assert [start(client, mission) for mission in missions] == ["starting", "starting", "queued"]
    for mission in missions[:2]:
        wait_for(client, mission, "running")
    assert client.get("/api/v1/missions").json()["running"] == missions[:2]
    ended(client, missions[1])
    wait_for(client, missions[2], "running")
    ended(client, missions[0], missions[2])


def test_the_queue_goes_on_by_itself_when_missions_end_or_fail(service):
    client = service("run_failing")
    missions = [create(client, seed=seed) for seed in range(3)]
    for mission in missions:
        start(client, mission)
    for mission in missions:
        wait_for(client, mission, "failed")
    assert client.get("/api/v1/missions").json()["queued"] == []


def test_the_queue_outlives_the_service_and_goes_on_in_order(service):
    client = service("run_long")
    first = begin(client)
    wait_for(client, first, "running")
    waiting = [create(client, seed=seed) for seed in (1, 2)]
    for mission in waiting:
        start(client, mission)
    again = service("run_long")
    states = {m["id"]: m["state"] for m in again.get("/api/v1/missions").json()["missions"]}
    assert states[first] == "interrupted"
    wait_for(again, waiting[0], "running")
    assert again.get("/api/v1/missions").json()["queued"] == [waiting[1]]
    told = again.get(f"/api/v1/missions/{waiting[0]}/events", params={"kind": "state"}).json()["events"]
    assert [event["state"] for event in told] == ["queued", "starting", "running"]
    ended(again, waiting[1], waiting[0])


def test_a_mission_that_was_never_started_is_there_after_a_restart(service):
    mission = create(service(), seed=9)
    again = service("run_short")
    assert again.get(f"/api/v1/missions/{mission}").json()["state"] == "created"
    again.post(f"/api/v1/missions/{mission}/start")
    wait_for(again, mission, "completed")


def test_missions_are_listed_in_pages_and_by_state(service):
    client = service()
    made = [create(client, seed=seed) for seed in range(7)][::-1]
    seen, cursor = [], None
    while True:
        query = {"limit": 3, **({"cursor": cursor} if cursor else {})}
        page = client.get("/api/v1/missions", params=query).json()
        seen += [mission["id"] for mission in page["missions"]]
        cursor = page["next_cursor"]
        if cursor is None:
            break
    assert seen == made
    client.post(f"/api/v1/missions/{made[2]}/stop")
    found = client.get("/api/v1/missions", params={"state": ["aborted", "failed"]}).json()["missions"]
    assert [mission["id"] for mission in found] == [made[2]]
    for query in ({"limit": 0}, {"limit": 501}, {"cursor": "x"}, {"cursor": "1~../x"}, {"state": "lost"}):
        assert client.get("/api/v1/missions", params=query).status_code == 422


def test_a_key_stands_for_one_request_for_ever(service):
    client = service()
    wish = {"preset": "quick", "seed": 5}
    first = client.post("/api/v1/missions", json=wish, headers={"Idempotency-Key": "k1"}).json()["id"]
    client.post(f"/api/v1/missions/{first}/stop")
    again = service().post("/api/v1/missions", json=wish, headers={"Idempotency-Key": "k1"})
    assert (again.status_code, again.json()["id"], again.json()["state"]) == (200, first, "aborted")


def test_a_saved_preset_makes_missions_that_keep_what_it_said_then(service):
    client = service("run_short")
    saved = {"base": "quick", "description": "mine", "overrides": {"limits.max_time_s": "30"}}
    assert client.put("/api/v1/presets/mine", json=saved).status_code == 201
    mission = create(client, preset="mine")
    assert client.put("/api/v1/presets/mine", json={**saved, "base": "paper"}).status_code == 200
    found = client.get(f"/api/v1/missions/{mission}").json()
    assert (found["preset"], found["overrides"]) == ("mine", {"limits.max_time_s": "30"})
    record = client.app.state.service.get(mission).record
    assert record.preset_source == "quick"
    entry = client.get("/api/v1/presets/mine").json()
    assert (entry["built_in"], entry["base"], entry["description"]) == (False, "paper", "mine")
    assert client.delete("/api/v1/presets/mine").status_code == 204
    assert client.get("/api/v1/presets/mine").status_code == 404
    client.post(f"/api/v1/missions/{mission}/start")
    wait_for(client, mission, "completed")

    for name, wish, status in (
        ("paper", saved, 409),
        ("mine", {**saved, "base": "slow"}, 422),
        ("mine", {**saved, "overrides": {"nothing.at.all": "1"}}, 422),
        ("a b", saved, 422),
    ):
        refused = client.put(f"/api/v1/presets/{name}", json=wish)
        assert refused.status_code == status, refused.text
    assert client.delete("/api/v1/presets/paper").status_code == 409


def test_stop_is_safe_to_repeat_in_every_state(service):
    client = service("run_long")
    mission = create(client)
    for _ in range(3):
        assert client.post(f"/api/v1/missions/{mission}/stop").json()["state"] == "aborted"
    running = begin(client)
    for _ in range(3):
        assert client.post(f"/api/v1/missions/{running}/stop").status_code == 202
    wait_for(client, running, "aborted")
    told = client.get(f"/api/v1/missions/{running}/events", params={"kind": "state"}).json()["events"]
    assert [e["state"] for e in told].count("stopping") == 1
    wait_until(lambda: client.app.state.service.running() == [])


def test_one_that_cannot_be_taken_from_the_queue_stays_and_holds_nobody_up(service, monkeypatch):
    client = service("run_long")
    first, second, third = begin(client), create(client, seed=1), create(client, seed=2)
    start(client, second)
    start(client, third)
    began = Mission.begin
    tried = []

    def full_disk(mission, launch):
        tried.append(mission.id)
        raise OSError("no space left on device")

    monkeypatch.setattr(Mission, "begin", full_disk)
    ended(client, first)
    wait_until(lambda: tried)
    assert client.get("/api/v1/missions").json()["queued"] == [second, third]
    assert tried == [second]
    monkeypatch.setattr(Mission, "begin", began)
    ended(client, third)
    start(client, create(client, seed=3))
    wait_for(client, second, "running")
    ended(client, second)
