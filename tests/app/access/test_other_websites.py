"""What another website cannot do, and what pages may."""

import pytest

from app.security.access import HostList
from app.settings import AccessSettings
from tests.app.access.clients import (
    API,
    OPERATOR,
    OWN_PAGE,
    TOKENS,
    VIEWER,
    bearer,
    create_with,
    log_in,
    refused_stream,
)


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost.evil.example", ""),
        *("127.0.0.1@evil.example", "localhost:80:80", "127.0.0.1/../x", "10.0.0.7", "[::2]", "localhost;x"),
    ],
)
def test_a_foreign_host_name_is_refused(service, host):
    """Another site's name may point at 127.0.0.1 (DNS rebinding)."""
    client = service()
    for path in ("/", f"{API}/missions", "/healthz"):
        answer = client.get(path, headers={"Host": host})
        assert answer.status_code == 403, path
        assert answer.headers["content-type"] == "application/problem+json"
        assert host == "" or host not in answer.headers["content-security-policy"]
    assert refused_stream(client, f"{API}/missions/m/events", headers={"Host": host}) == 403


@pytest.mark.parametrize(
    "host", ["localhost:8000", "127.0.0.1", "[::1]:9000", "LOCALHOST", "robot.example:443"]
)
def test_names_of_this_machine_and_listed_ones_are_answered(service, host):
    client = service(access=AccessSettings(allowed_hosts=("robot.example",)))
    assert client.get(f"{API}/missions", headers={"Host": host}).status_code == 200


def test_where_all_addresses_are_listened_on_an_address_is_a_fine_name_and_a_foreign_name_is_not():
    hosts = HostList("0.0.0.0", ())
    for host in ("10.0.0.7:8000", "[2001:db8::1]", "localhost"):
        hosts.check(host)
    with pytest.raises(Exception, match="does not answer"):
        hosts.check("evil.example")


FOREIGN = [
    *("https://evil.example", "null", "http://127.0.0.1:9999", "http://localhost", "file://", ""),
    *(
        "http://127.0.0.1.evil.example",
        "http://evil.example/http://127.0.0.1",
        "http://127.0.0.1@evil.example",
    ),
]


@pytest.mark.parametrize("origin", FOREIGN)
def test_another_page_can_neither_command_nor_listen(service, origin):
    """With tokens and without: a page from elsewhere acts in the browser of somebody who is logged in."""
    for access in (AccessSettings(), TOKENS):
        client = service(access=access)
        if access is TOKENS:
            log_in(client, OPERATOR)
        mission = create_with(client)
        foreign = {"Origin": origin}
        for method, path in (
            ("POST", "/missions"),
            ("POST", f"/missions/{mission}/start"),
            ("POST", f"/missions/{mission}/stop"),
            ("PUT", "/presets/mine"),
            ("DELETE", "/presets/mine"),
            ("POST", "/session"),
            ("DELETE", "/session"),
        ):
            answer = client.request(method, API + path, json={"preset": "quick"}, headers=foreign)
            assert answer.status_code == 403, path
        assert client.get(f"{API}/missions/{mission}").json()["state"] == "created"
        for path in (f"{API}/missions/{mission}/events", f"/viewer/{mission}"):
            assert refused_stream(client, path, headers=foreign) == 403
        assert client.post(f"{API}/missions/{mission}/stop", headers=OWN_PAGE).status_code == 202


def test_a_cookie_without_an_origin_changes_nothing(service):
    """Browsers always say where such a request comes from; what does not is no page of ours."""
    client = service(access=TOKENS)
    log_in(client, OPERATOR)
    mission = create_with(client)
    assert client.post(f"{API}/missions/{mission}/stop").status_code == 403
    assert refused_stream(client, f"{API}/missions/{mission}/events") == 403
    assert client.get(f"{API}/missions/{mission}").status_code == 200
    program = {"Authorization": f"Bearer {OPERATOR}"}
    client.cookies.clear()
    assert client.post(f"{API}/missions/{mission}/stop", headers=program).status_code == 202


def test_pages_are_strict_and_only_the_viewer_may_evaluate(service):
    client = service(access=TOKENS)
    for path in ("/", "/login.html", "/js/main.js", "/nothing", f"{API}/session", f"{API}/missions"):
        headers = client.get(path).headers
        policy = headers["content-security-policy"]
        assert "unsafe" not in policy
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
    assert client.get(f"{API}/session").headers["cache-control"] == "no-store"
    policy = client.get("/viewer/m/", headers=bearer(VIEWER)).headers["content-security-policy"]
    assert "'unsafe-eval'" in policy
    assert "'wasm-unsafe-eval'" in policy
    assert "frame-ancestors 'self'" in policy
    sources = policy.replace("ws://127.0.0.1", "").replace("wss://127.0.0.1", "")
    assert "//" not in sources  # nothing comes from elsewhere, and nothing goes there


def test_an_unexpected_error_tells_no_detail_and_keeps_the_headers(service, monkeypatch):
    client = service()
    monkeypatch.setattr(client.app.state.service, "page", lambda *_, **__: 1 / 0)
    answer = client.get(f"{API}/missions")
    assert answer.status_code == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert "content-security-policy" in answer.headers
    assert "division" not in answer.text
