"""Who may do what."""

import pytest

from app.security.access import COOKIE
from app.security.tokens import digest_of
from app.settings import LimitSettings
from tests.app.access.clients import (
    API,
    OPEN,
    OPERATOR,
    OWN_PAGE,
    TOKENS,
    VIEWER,
    WS,
    bearer,
    log_in,
    refused_stream,
)


def requests_of(client):
    """One request of every route there is: `(method, path)` with a made-up mission."""
    schema = client.get("/openapi.json", headers=bearer(OPERATOR)).json()
    for path, methods in schema["paths"].items():
        filled = path.replace("{mission_id}", "m").replace("{kind}", "depth").replace("{name}", "n")
        for method in methods:
            yield method.upper(), filled
    yield "GET", "/viewer/m"
    yield "GET", "/viewer/m/"
    yield "GET", "/openapi.json"


@pytest.mark.parametrize(
    "headers",
    [
        {},
        bearer("a guess"),
        bearer(""),
        bearer(digest_of(OPERATOR)),
        bearer(OPERATOR.upper()),
        {"Authorization": OPERATOR},
        {"Authorization": f"Basic {OPERATOR}"},
        {"Authorization": f"Bearer {OPERATOR}x"},
        {"Cookie": f"{COOKIE}={OPERATOR}"},
        {"Cookie": f"{COOKIE}="},
        {"X-Token": OPERATOR},
    ],
)
def test_without_a_right_token_nothing_is_told_and_nothing_done(service, headers):
    client = service(access=TOKENS, limits=LimitSettings(logins="100000/minute"))
    create_wish = {"preset": "quick"}
    tried = 0
    for method, path in requests_of(client):
        answer = client.request(method, path, json=create_wish, headers=headers, follow_redirects=False)
        if (method, path) in OPEN:
            assert answer.status_code == (401 if "Authorization" in headers else 200)
        elif path == f"{API}/session":
            assert answer.status_code in (401, 403, 422, 204)
        else:
            tried += 1
            assert answer.status_code == 401, (method, path)
            assert answer.headers["content-type"] == "application/problem+json"
            assert answer.headers["www-authenticate"] == "Bearer"
    assert tried > 20
    for path in (f"{API}/missions/m/events", "/viewer/m"):
        assert refused_stream(client, path, headers=headers) == 401
    # Not in the address, either: it would end up in logs.
    assert client.get(f"{API}/system", params={"token": OPERATOR}).status_code == 401
    assert client.app.state.service.page(10) == []


def test_a_viewer_sees_all_and_changes_nothing(service):
    client = service("run_short", access=TOKENS)
    mission = client.post(f"{API}/missions", json={"preset": "quick"}, headers=bearer(OPERATOR)).json()["id"]
    refused = 0
    for method, path in requests_of(client):
        if path == f"{API}/session" or path.endswith("/stream"):
            continue
        answer = client.request(
            method,
            path.replace("/m/", f"/{mission}/"),
            json={},
            headers=bearer(VIEWER),
            follow_redirects=False,
        )
        if method == "GET":
            assert (answer.status_code == 403) == (path in (f"{API}/audit", f"{API}/missions/m/bundle")), path
            assert answer.status_code != 401, path
        else:
            refused += 1
            assert answer.status_code == 403, (method, path)
    assert refused >= 7
    assert client.get(f"{API}/missions/{mission}", headers=bearer(OPERATOR)).json()["state"] == "created"
    with client.websocket_connect(f"{WS}{API}/missions/{mission}/events", headers=bearer(VIEWER)) as events:
        assert events.receive_json()["kind"] == "alive"
    log_in(client, VIEWER)
    stopped = client.post(f"{API}/missions/{mission}/stop", headers=OWN_PAGE)
    assert stopped.status_code == 403
    assert "needs an operator" in stopped.json()["detail"]
