"""The description of the interface, and the running service held against it."""

import sys
import time

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from openapi_spec_validator import validate

from app.settings import LimitSettings, Settings
from tests.app.fake_mission import runner
from tests.app.live_service import serving
from tests.app.wild_requests import ENDLESS, send_wild_requests

TOKEN = "an operator's token for the tests"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
UNLIMITED = LimitSettings(requests="1000000/second", changes="1000000/second", logins="1000000/second")


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A service with a token, a mission that has ended, and the fake runner, so that starting is cheap."""
    folder = tmp_path_factory.mktemp("interface")
    given = Settings(
        data_dir=folder / "data",
        viewer=False,
        mission_threads=1,
        limits=UNLIMITED,
        access={"operator_token": TOKEN},
        display={"interval_s": 0.05},
    )
    with serving(given, runner=runner("run_short")) as service:
        yield service


@pytest.fixture(scope="module")
def description(live):
    return httpx.get(f"{live.url}openapi.json", headers=BEARER).json()


@pytest.fixture(scope="module")
def missions(live):
    """One mission that has ended and one that was never started, for requests to be about something real."""
    with httpx.Client(base_url=live.url, headers=BEARER) as client:
        ended, waiting = (
            client.post("/api/v1/missions", json={"preset": "quick", "seed": seed}).json()["id"]
            for seed in (0, 1)
        )
        client.post(f"/api/v1/missions/{ended}/start")
        while client.get(f"/api/v1/missions/{ended}").json()["state"] != "completed":
            time.sleep(0.05)
    return [ended, waiting]


def operations(description):
    return [
        (path, method, operation)
        for path, methods in description["paths"].items()
        for method, operation in methods.items()
    ]


def test_the_description_is_valid_openapi(description):
    validate(description)


def test_operations_have_stable_names(description):
    """A generated client calls them by these: a name that goes is a break, a new one belongs here."""
    names = sorted(operation["operationId"] for _, _, operation in operations(description))
    assert names == sorted(
        [
            *("openSession", "getSession", "closeSession"),
            *("listScenes", "listPresets", "getPreset", "getPresetSettings", "savePreset", "deletePreset"),
            *("listMissions", "createMission", "getMission", "getPlan", "getRobot"),
            *("startMission", "pauseMission", "resumeMission", "stopMission"),
            *("getDirectives", "putDirectives", "decideApproval"),
            *("getMetrics", "listEvents", "streamEvents", "getImage", "listResults", "getResult"),
            *("downloadResults", "getTopView", "getTopViewImage"),
            *("listMoments", "getMoment", "getMomentTopView", "getMomentImage"),
            *("pinMission", "unpinMission", "downloadBundle"),
            *("getSystem", "listAudit", "getHealth", "getReadiness", "getServiceMetrics"),
        ]
    )


def test_every_operation_tells_how_it_fails(description):
    problem = {"$ref": "#/components/schemas/Problem"}
    for path, method, operation in operations(description):
        name = operation["operationId"]
        answers = operation["responses"]
        failures = {status: answer for status, answer in answers.items() if status >= "4" and status != "416"}
        assert {"401", "403", "429"} <= set(failures), name
        if "requestBody" in operation:
            assert {"400", "413", "422"} <= set(failures), name
        if "{mission_id}" in path:
            assert "404" in failures, name
        if name in ("startMission", "pauseMission", "resumeMission", "createMission"):
            assert "409" in failures
        for status, answer in failures.items():
            assert answer["description"], (name, status)
            assert answer["content"]["application/problem+json"]["schema"] == problem, (name, status)
        assert operation.get("summary"), (method, path)


def test_the_bodies_that_can_be_sent_come_with_examples_that_work(description, live):
    schemas = description["components"]["schemas"]
    with httpx.Client(base_url=live.url, headers=BEARER) as client:
        wish = {
            name: p["examples"][0]
            for name, p in schemas["MissionCreate"]["properties"].items()
            if "examples" in p and name != "extends"  # which mission there is, no description can know
        }
        assert set(wish) >= {"scene", "preset"}
        assert client.post("/api/v1/missions", json=wish).status_code == 201
        preset = {name: p["examples"][0] for name, p in schemas["PresetSave"]["properties"].items()}
        assert client.put("/api/v1/presets/example", json=preset).status_code == 201
        assert client.delete("/api/v1/presets/example").status_code == 204


def test_wild_requests_are_answered_as_described(live, missions):
    assert send_wild_requests(live.url, missions, token=TOKEN, examples=12, same=True) > 150


@pytest.mark.parametrize(
    ("field", "value"),
    [("max_time_s", True), ("max_time_s", "60"), ("seed", True), ("seed", "1"), ("seed", 1.5)],
)
def test_numbers_are_numbers(live, field, value):
    """`true` is no duration and `"1"` no seed, though Python would make numbers of both."""
    answer = httpx.post(f"{live.url}api/v1/missions", headers=BEARER, json={field: value})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"].endswith(field)


@pytest.mark.slow
def test_very_many_wild_requests_are_answered_as_described(live, missions, capsys):
    sent = send_wild_requests(live.url, missions, token=TOKEN, examples=1_000, same=False)
    with capsys.disabled():
        sys.stdout.write(f"{sent} requests by schemathesis: no server error, no answer off the description\n")
    assert sent > 10_000


@pytest.mark.slow
def test_long_chains_of_wild_requests_are_answered_as_described(live):
    """What one answer gives (an id, a name) goes into the next request."""
    machine = schemathesis.openapi.from_url(f"{live.url}openapi.json", headers=BEARER)
    machine = machine.exclude(operation_id=ENDLESS).as_state_machine()
    machine.run(
        settings=settings(
            max_examples=100, stateful_step_count=20, deadline=None, suppress_health_check=list(HealthCheck)
        )
    )
