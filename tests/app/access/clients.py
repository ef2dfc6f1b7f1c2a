"""Who asks in the tests of access, and how."""

import pytest
from starlette.testclient import WebSocketDenialResponse

from app.settings import AccessSettings

OPERATOR = "the operator's token, long enough"
VIEWER = "the viewer's token, long enough"
TOKENS = AccessSettings(operator_token=OPERATOR, viewer_token=VIEWER)
API = "/api/v1"
WS = "ws://127.0.0.1"
OWN_PAGE = {"Origin": "http://127.0.0.1"}
OPEN = {("GET", "/healthz"), ("GET", "/readyz"), ("GET", "/api/v1/session")}
"""What needs no login. Logging in and out is checked on its own."""


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def log_in(client, token: str):
    answer = client.post(f"{API}/session", json={"token": token}, headers=OWN_PAGE)
    assert answer.status_code == 201, answer.text
    return answer


def audit(client) -> list[dict]:
    return client.get(f"{API}/audit", headers=bearer(OPERATOR)).json()["entries"]


def refused_stream(client, path: str, **options) -> int:
    """The status with which a WebSocket is refused before it opens."""
    with (
        pytest.raises(WebSocketDenialResponse) as refusal,
        client.websocket_connect(f"{WS}{path}", **options),
    ):
        pass
    assert refusal.value.headers["content-type"] == "application/problem+json"
    return refusal.value.status_code


def create_with(client) -> str:
    return client.post(f"{API}/missions", json={"preset": "quick"}, headers=OWN_PAGE).json()["id"]
