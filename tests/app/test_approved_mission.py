"""A whole mission, each of whose views an operator decides on: approved, refused, or another one instead."""

import math
import time
from itertools import pairwise

import httpx
import pytest

from tests.app.served import served
from tests.mission.small_room import TINY, write_small_room

REFUSED, INSTEAD = 3, 4
"""Every third view is refused, every fourth has another candidate put in its place."""
THINKS = 3
"""Over the first few the operator takes a second: frames go on coming, and the robot must stand."""


class Operator:
    """Decides as a person would who has a rule: looks at what waits, answers, and looks again."""

    def __init__(self, client: httpx.Client, mission: str) -> None:
        self._client = client
        self._path = f"/missions/{mission}"
        self.refused: list[tuple[float, float]] = []
        self.sent_to: list[tuple[float, float]] = []
        self.decided = 0

    def until_the_end(self) -> dict:
        deadline, last = time.monotonic() + 600, 0
        while (found := self._client.get(self._path).json())["ended_at"] is None:
            assert time.monotonic() < deadline, found
            waiting = found["approval"]
            if waiting is None or waiting["plan_sequence"] == last:
                time.sleep(0.02)
                continue
            last = waiting["plan_sequence"]
            self._decide(waiting)
        return found

    def events(self, kind: str) -> list[dict]:
        found = self._client.get(f"{self._path}/events", params={"kind": kind, "limit": 1000}).json()
        assert not found["more"]
        return found["events"]

    def _decide(self, waiting: dict) -> None:
        sequence, view = waiting["plan_sequence"], waiting["view"]
        here = (view["x_m"], view["y_m"])
        self.decided += 1
        if self.decided <= THINKS:
            time.sleep(1.0)
        said = {"plan_sequence": sequence, "decision": "approve"}
        if self.decided % REFUSED == 0:
            said["decision"] = "reject"
        elif self.decided % INSTEAD == 0 and (other := self._another(sequence, here)) is not None:
            said["candidate"], here = other
        answer = self._client.post(f"{self._path}/approval", json=said)
        if answer.status_code == 409:  # the plan was given up meanwhile: something new was seen
            return
        assert answer.status_code == 202, answer.text
        (self.refused if said["decision"] == "reject" else self.sent_to).append(here)

    def _another(self, sequence: int, than: tuple[float, float]) -> tuple[int, tuple[float, float]] | None:
        """The first candidate of the plan that was outranked, elsewhere."""
        plan = self._client.get(f"{self._path}/plan").json()
        if plan["plan_sequence"] != sequence:
            return None
        for number, candidate in enumerate(plan["candidates"]):
            place = (candidate["x_m"], candidate["y_m"])
            if candidate["status"] == "outranked" and math.dist(place, than) > 0.3:
                return number, place
        return None


@pytest.mark.slow
def test_a_mission_whose_every_view_is_decided_on_ends_by_itself(tmp_path):
    (tmp_path / "scenes").mkdir()
    write_small_room(tmp_path / "scenes")
    with (
        served(tmp_path / "data", scenes_dir=tmp_path / "scenes", viewer=False, mission_threads=1) as service,
        httpx.Client(base_url=service.api, timeout=120) as client,
    ):
        wish = {"scene": "room.glb", "preset": "quick", "overrides": TINY}
        asked = client.post("/missions", json={**wish, "directives": {"approve_views": True}})
        mission = asked.raise_for_status().json()["id"]
        client.post(f"/missions/{mission}/start").raise_for_status()
        operator = Operator(client, mission)
        ended = operator.until_the_end()
        assert (ended["state"], ended["stop_reason"]) == ("completed", "complete"), ended
        approvals = operator.events("approval")
        telemetry = operator.events("telemetry")
    assert operator.decided >= 2 * REFUSED
    assert len(operator.refused) >= 2
    assert telemetry[-1]["collisions"] == 0
    counted = {state: sum(e["state"] == state for e in approvals) for state in ("approved", "rejected")}
    assert counted["rejected"] == len(operator.refused)
    assert counted["approved"] == len(operator.sent_to)
    # Whatever it drove to is a view that it was sent to.
    driven = [(e["view"]["x_m"], e["view"]["y_m"]) for e in approvals if e["state"] == "approved"]
    for place, told in zip(operator.sent_to, driven, strict=True):
        assert math.dist(place, told) < 0.1
    # While it waits it stands: no metre of path between the question and the answer.
    waits = 0
    for asked_event, answered in pairwise(approvals):
        if asked_event["state"] != "waiting":
            continue
        lengths = [
            e["path_length_m"]
            for e in telemetry
            if asked_event["sequence"] < e["sequence"] < answered["sequence"]
        ]
        waits += len(lengths) > 1
        assert not lengths or max(lengths) - min(lengths) < 0.01, asked_event
    assert waits > 0
