"""How much is taken from whom."""

import io

import pytest

from app.settings import LimitSettings
from tests.app.access.clients import (
    API,
    OPERATOR,
    OWN_PAGE,
    TOKENS,
    WS,
    bearer,
    refused_stream,
)
from tests.app.conftest import create


def test_logins_are_rated_right_tokens_too(service):
    client = service(access=TOKENS, limits=LimitSettings(logins="5/minute"))
    answers = [
        client.post(f"{API}/session", json={"token": f"guess {n}"}, headers=OWN_PAGE).status_code
        for n in range(8)
    ]
    assert answers == [401] * 5 + [429] * 3
    refused = client.post(f"{API}/session", json={"token": OPERATOR}, headers=OWN_PAGE)
    assert refused.status_code == 429
    assert 1 <= int(refused.headers["retry-after"]) <= 60


def test_wrong_tokens_are_rated_and_keep_nobody_from_stop(service):
    client = service(access=TOKENS, limits=LimitSettings(logins="5/minute"))
    mission = client.post(f"{API}/missions", json={"preset": "quick"}, headers=bearer(OPERATOR)).json()["id"]
    answers = [client.get(f"{API}/system", headers=bearer(f"guess {n}")).status_code for n in range(8)]
    assert answers == [401] * 5 + [429] * 3
    stopped = client.post(f"{API}/missions/{mission}/stop", headers=bearer(OPERATOR))
    assert stopped.status_code == 202


def test_requests_and_changes_are_rated_but_stop_is_not(service):
    limits = LimitSettings(requests="30/minute", changes="5/minute")
    client = service(limits=limits)
    made = [client.post(f"{API}/missions", json={"preset": "quick"}) for _ in range(7)]
    assert [answer.status_code for answer in made] == [201] * 5 + [429] * 2
    assert made[-1].headers["content-type"] == "application/problem+json"
    answers = [client.get("/healthz").status_code for _ in range(40)]
    assert answers[-1] == 429
    for _ in range(50):
        assert client.post(f"{API}/missions/{made[0].json()['id']}/stop").status_code == 202


def test_streams_are_counted(service):
    client = service(limits=LimitSettings(streams=2))
    mission = create(client)
    path = f"{API}/missions/{mission}/events"
    with client.websocket_connect(f"{WS}{path}"), client.websocket_connect(f"{WS}{path}"):
        assert refused_stream(client, path) == 429
    with client.websocket_connect(f"{WS}{path}") as events:
        assert events.receive_json()["kind"] == "alive"


def test_bodies_are_limited_whatever_they_say_of_their_size(service):
    client = service(limits=LimitSettings(body_bytes=4096))
    for body in (b"x" * 5000, b'{"scene": "' + b"x" * 5000 + b'"}'):
        answer = client.post(f"{API}/missions", content=body)
        assert answer.status_code == 413
        assert answer.headers["content-type"] == "application/problem+json"

    def parts():
        for _ in range(100):
            yield b" " * 100

    assert client.post(f"{API}/missions", content=parts()).status_code == 413
    assert client.get(f"{API}/missions").json()["missions"] == []


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"{", b"null", b"[]", b'"x"', b"\xff\xfe", b"\x00", b"NaN", b'{"seed": 1e999}'),
        *(b'{"seed": NaN}', b'{"scene": "house\\u0000"}', b'{"scene": "\\ud800"}', b"[" * 50_000),
        *(
            b'{"overrides": {"a": {}}}',
            b'{"seed": 99999999999999999999999}',
            b'{"scene": "' + b"../" * 60 + b'"}',
        ),
    ],
)
def test_malformed_bodies_are_refused_in_words(service, body):
    client = service()
    answer = client.post(f"{API}/missions", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code in (400, 422), answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert client.get(f"{API}/missions").json()["missions"] == []


def test_other_kinds_of_bodies_are_refused(service):
    client = service()
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        answer = client.post(
            f"{API}/missions", content=b'{"preset": "quick"}', headers={"Content-Type": kind}
        )
        assert answer.status_code == 422  # what a foreign page can send without asking first
    files = {"file": ("../../x", io.BytesIO(b"glTF"))}
    assert client.post(f"{API}/scenes", files=files).status_code == 405
