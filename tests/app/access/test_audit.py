"""What is remembered of commands, and what is not."""

import httpx
import pytest

from app.security.access import COOKIE
from tests.app.access.clients import (
    API,
    OPERATOR,
    OWN_PAGE,
    TOKENS,
    VIEWER,
    audit,
    bearer,
    create_with,
    log_in,
)
from tests.app.conftest import begin, wait_for


def test_every_attempt_to_change_something_is_written_down(service):
    client = service("run_long", access=TOKENS)
    client.post(f"{API}/session", json={"token": "a guess"}, headers=OWN_PAGE)
    log_in(client, OPERATOR)
    mission = create_with(client)
    client.post(f"{API}/missions/{mission}/start", headers=OWN_PAGE)
    wait_for(client, mission, "running")
    client.post(f"{API}/missions/{mission}/stop", headers={"Origin": "https://evil.example"})
    client.cookies.clear()
    client.post(f"{API}/missions/{mission}/pause", headers=bearer(VIEWER))
    client.post(f"{API}/missions/{mission}/pause%00%0a", headers=bearer("x"))
    client.post(f"{API}/missions/{mission}/stop", headers=bearer(OPERATOR))
    found = [(e["actor"], e["role"], e["path"].removeprefix(API), e["status"]) for e in audit(client)][::-1]
    assert found == [
        ("unknown", "none", "/session", 401),
        ("unknown", "none", "/session", 201),
        ("operator", "operator", "/missions", 201),
        ("operator", "operator", f"/missions/{mission}/start", 202),
        ("operator", "operator", f"/missions/{mission}/stop", 403),
        ("viewer", "viewer", f"/missions/{mission}/pause", 403),
        ("unknown", "none", f"/missions/{mission}/pause??", 401),
        ("operator", "operator", f"/missions/{mission}/stop", 202),
    ]
    assert OPERATOR not in str(audit(client))
    first = client.get(f"{API}/audit", params={"limit": 3}, headers=bearer(OPERATOR)).json()
    rest = client.get(
        f"{API}/audit", params={"before": first["next_before"], "limit": 1000}, headers=bearer(OPERATOR)
    ).json()
    assert len(first["entries"]) + len(rest["entries"]) == len(found)
    assert rest["next_before"] is None
    assert client.get(f"{API}/missions/{mission}", headers=bearer(VIEWER)).json()["created_by"] == "operator"


def test_no_secret_lies_in_the_data_folder(service, tmp_path):
    client = service(access=TOKENS)
    log_in(client, OPERATOR)
    cookie = client.cookies[COOKIE]
    files = [path for path in (tmp_path / "data").rglob("*") if path.is_file()]
    assert any(path.name.startswith("hgs.db") for path in files)
    for path in files:
        content = path.read_bytes()
        assert OPERATOR.encode() not in content
        assert cookie.encode() not in content
    assert (tmp_path / "data").stat().st_mode & 0o077 == 0


def test_a_key_replayed_by_somebody_else_gives_nothing_away(service):
    client = service(access=TOKENS)
    key = {"Idempotency-Key": "k"}
    wish = {"preset": "quick", "seed": 1}
    made = client.post(f"{API}/missions", json=wish, headers={**key, **bearer(OPERATOR)})
    for stranger in ({}, bearer("x"), bearer(VIEWER)):
        assert client.post(f"{API}/missions", json=wish, headers={**key, **stranger}).status_code in (
            401,
            403,
        )
    other = client.post(f"{API}/missions", json={"preset": "paper"}, headers={**key, **bearer(OPERATOR)})
    assert other.status_code == 409
    again = client.post(f"{API}/missions", json=wish, headers={**key, **bearer(OPERATOR)})
    assert (again.status_code, again.json()["id"]) == (200, made.json()["id"])


@pytest.mark.parametrize("key", ["", " ", "x" * 201, "tab\tbed"])
def test_a_key_that_is_none_is_refused(service, key):
    answer = service().post(f"{API}/missions", json={"preset": "quick"}, headers={"Idempotency-Key": key})
    assert answer.status_code == 422


def test_results_of_a_mission_need_a_login_like_the_rest(service):
    client = service("run_short", access=TOKENS)
    client.headers.update(bearer(OPERATOR))
    mission = begin(client)
    wait_for(client, mission, "completed")
    path = f"{API}/missions/{mission}/results/report.json"
    assert client.get(path).status_code == 200
    assert httpx.Headers(client.get(path).headers)["content-disposition"].startswith("attachment")
    del client.headers["Authorization"]
    assert client.get(path).status_code == 401
