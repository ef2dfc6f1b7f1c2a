"""Browsers that log in."""

import time

from app.security.access import COOKIE
from app.security.principal import Role
from app.security.sessions import SessionBook
from app.security.tokens import TokenBook, new_token
from app.storage.logins import LoginStore
from tests.app.access.clients import (
    API,
    OPERATOR,
    OWN_PAGE,
    TOKENS,
    VIEWER,
    WS,
    create_with,
    log_in,
    refused_stream,
)


def test_a_browser_logs_in_and_out(service):
    client = service(access=TOKENS)
    info = client.get(f"{API}/session").json()
    assert info == {"login_required": True, "name": None, "role": None, "expires_at": None}
    answer = log_in(client, OPERATOR)
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert "path=/" in cookie
    assert OPERATOR not in answer.text
    assert OPERATOR not in cookie
    info = client.get(f"{API}/session").json()
    assert (info["role"], info["name"]) == ("operator", "operator")
    assert info["expires_at"] > time.time() + 3600
    mission = client.post(f"{API}/missions", json={"preset": "quick"}, headers=OWN_PAGE)
    assert mission.status_code == 201
    stolen = dict(client.cookies)
    assert client.delete(f"{API}/session", headers=OWN_PAGE).status_code == 204
    assert dict(client.cookies) == {}
    # Ended here, not only forgotten by the browser.
    client.cookies.update(stolen)
    assert client.get(f"{API}/system").status_code == 401


def test_over_https_the_cookie_stays_there(service):
    client = service(access=TOKENS)
    client.base_url = "https://127.0.0.1"
    answer = client.post(f"{API}/session", json={"token": OPERATOR}, headers={"Origin": "https://127.0.0.1"})
    assert "secure" in answer.headers["set-cookie"].lower()


def test_sessions_expire_and_end_with_their_token(database):
    secret, token = new_token(Role.OPERATOR, "alice")
    tokens, store, clock = TokenBook([token]), LoginStore(database), [1000.0]
    book = SessionBook(tokens, store, lifetime_s=60.0, now=lambda: clock[0])
    cookie, session = book.open(token)
    assert book.find(cookie) == session
    assert book.find(secret) is None
    assert all(cookie not in repr(row) and row.secret_digest != cookie for row in store.all())
    # A restart keeps it, unless the token has gone meanwhile.
    assert SessionBook(tokens, store, lifetime_s=60.0, now=lambda: clock[0]).find(cookie) == session
    assert SessionBook(TokenBook([]), store, lifetime_s=60.0, now=lambda: clock[0]).find(cookie) is None
    clock[0] += 60.0
    assert book.find(cookie) is None
    assert SessionBook(tokens, store, lifetime_s=60.0, now=lambda: clock[0]).find(cookie) is None
    book.open(token)
    assert len(store.all()) == 1


def test_an_expired_session_opens_nothing_and_may_log_in_again(service, monkeypatch):
    client = service(access=TOKENS)
    log_in(client, OPERATOR)
    mission = create_with(client)
    with client.websocket_connect(f"{WS}{API}/missions/{mission}/events", headers=OWN_PAGE) as events:
        secret = client.cookies[COOKIE]
        a_year_s = 365 * 86_400.0
        monkeypatch.setattr(client.app.state.sessions, "_now", lambda: time.time() + a_year_s)
        while (message := events.receive())["type"] != "websocket.close":
            pass
        assert message["code"] == 4401  # a stream ends with the login that opened it
    stale = {"Cookie": f"{COOKIE}={secret}"}
    client.cookies.clear()
    answer = client.get(f"{API}/system", headers=stale)
    assert answer.status_code == 401
    assert "expired" in answer.json()["detail"]
    assert client.post(f"{API}/missions/{mission}/stop", headers={**stale, **OWN_PAGE}).status_code == 401
    assert refused_stream(client, f"{API}/missions/{mission}/events", headers={**stale, **OWN_PAGE}) == 401
    assert client.get(f"{API}/session", headers=stale).json()["role"] is None
    assert (
        client.post(f"{API}/session", json={"token": OPERATOR}, headers={**stale, **OWN_PAGE}).status_code
        == 201
    )


def test_a_session_outlives_a_restart(service):
    client = service(access=TOKENS)
    log_in(client, VIEWER)
    secret = client.cookies[COOKIE]
    again = service(access=TOKENS)
    assert again.get(f"{API}/system", headers={"Cookie": f"{COOKIE}={secret}"}).status_code == 200
