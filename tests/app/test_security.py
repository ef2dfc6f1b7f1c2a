"""Every rule of access, and somebody who tries to break it."""

import io
import time

import httpx
import pytest
from starlette.testclient import WebSocketDenialResponse
from typer.testing import CliRunner

from app.cli.application import application
from app.security.access import COOKIE, HostList
from app.security.principal import Role
from app.security.sessions import SessionBook
from app.security.tokens import TokenBook, digest_of, new_token, tokens_of
from app.settings import AccessSettings, LimitSettings, Settings, settings_from_environment
from app.storage.logins import LoginStore
from hgs_core.errors import ConfigError
from tests.app.conftest import begin, create, wait_for

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


# --- where it listens ------------------------------------------------------------------------------------


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "example.org", ""])
def test_addresses_that_others_reach_need_a_token(host, tmp_path):
    bare = Settings(data_dir=tmp_path, host=host)
    with pytest.raises(ConfigError, match=r"without a token.*HGS_OPERATOR_TOKEN"):
        tokens_of(bare)
    assert not tokens_of(bare.model_copy(update={"access": TOKENS})).empty
    only_viewers = AccessSettings(viewer_token=VIEWER)
    with pytest.raises(ConfigError, match="none of an operator"):
        tokens_of(bare.model_copy(update={"access": only_viewers}))


def test_the_command_refuses_such_an_address_before_it_touches_anything(tmp_path):
    data = tmp_path / "data"
    answer = CliRunner().invoke(application, ["serve", "--host", "0.0.0.0", "--data-dir", str(data)])
    assert answer.exit_code == 2
    assert not data.exists()


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_this_machine_needs_none(host, tmp_path):
    assert tokens_of(Settings(data_dir=tmp_path, host=host)).empty


def test_the_environment_is_read(tmp_path):
    environment = {
        "HGS_OPERATOR_TOKEN": OPERATOR,
        "HGS_ALLOWED_HOSTS": "robot.example, 10.0.0.7",
        "HGS_DATABASE_URL": "postgresql://db/hgs",
        "HGS_VIEWER_TOKEN": "",
    }
    settings = settings_from_environment(
        host="127.0.0.1", port=8000, data_dir=tmp_path, demo=False, environment=environment
    )
    assert settings.access.allowed_hosts == ("robot.example", "10.0.0.7")
    assert settings.database == "postgresql://db/hgs"
    assert settings.access.viewer_token is None
    assert OPERATOR not in repr(settings)


@pytest.mark.parametrize("variable", ["HGS_SCENES_DIR", "HGS_TOKEN_FILE"])
def test_a_path_that_is_missing_is_an_error(tmp_path, variable):
    with pytest.raises(ConfigError, match=variable):
        settings_from_environment(
            host="127.0.0.1",
            port=8000,
            data_dir=tmp_path,
            demo=False,
            environment={variable: str(tmp_path / "nowhere")},
        )


# --- tokens ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "token", ["short", " padded with blanks, but long ", "not quite ASCII, but löng enough"]
)
def test_a_weak_token_is_refused(tmp_path, token):
    settings = Settings(data_dir=tmp_path, access=AccessSettings(operator_token=token))
    with pytest.raises(ConfigError, match="HGS_OPERATOR_TOKEN"):
        tokens_of(settings)


def test_a_file_of_hashes_holds_tokens_of_many(tmp_path, service):
    made = {name: new_token(role, name) for name, role in (("alice", Role.OPERATOR), ("bob", Role.VIEWER))}
    path = tmp_path / "tokens"
    path.write_text("# who may\n\n" + "\n".join(f"{token.line}  # since May" for _, token in made.values()))
    assert all(secret not in path.read_text() for secret, _ in made.values())
    client = service(access=AccessSettings(token_file=path))
    for name, (secret, _) in made.items():
        assert client.get(f"{API}/session", headers=bearer(secret)).json()["name"] == name
    # What stands in the file is no token.
    assert client.get(f"{API}/system", headers=bearer(made["alice"][1].digest)).status_code == 401


@pytest.mark.parametrize(
    "line", ["operator alice", "admin alice sha256:" + "0" * 64, "operator alice sha256:" + "0" * 63, "x"]
)
def test_a_wrong_line_of_the_file_is_named(tmp_path, line):
    path = tmp_path / "tokens"
    path.write_text(f"# one\n{line}\n")
    with pytest.raises(ConfigError, match="line 2"):
        tokens_of(Settings(data_dir=tmp_path, access=AccessSettings(token_file=path)))


def test_two_tokens_never_share_a_name_or_a_secret(tmp_path):
    for access in (
        AccessSettings(operator_token=OPERATOR, viewer_token=OPERATOR),
        AccessSettings(operator_token=OPERATOR, token_file=tmp_path / "tokens"),
    ):
        (tmp_path / "tokens").write_text(f"viewer operator sha256:{'0' * 64}\n")
        with pytest.raises(ConfigError, match="of its own"):
            tokens_of(Settings(data_dir=tmp_path, access=access))


def test_the_command_makes_tokens_that_work(tmp_path):
    answer = CliRunner().invoke(application, ["token", "viewer", "carol"])
    assert answer.exit_code == 0, answer.output
    (tmp_path / "tokens").write_text(answer.stdout)
    secret = answer.stderr.split()[-1]
    access = AccessSettings(operator_token=OPERATOR, token_file=tmp_path / "tokens")
    found = tokens_of(Settings(data_dir=tmp_path, access=access)).identify(secret)
    assert (found.name, found.role) == ("carol", Role.VIEWER)
    for wrong in (["token", "admin", "carol"], ["token", "viewer", "a b"]):
        assert CliRunner().invoke(application, wrong).exit_code == 2


# --- who may do what -------------------------------------------------------------------------------------


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
            assert (answer.status_code == 403) == (path == f"{API}/audit"), path
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


# --- sessions --------------------------------------------------------------------------------------------


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


def test_an_expired_session_opens_nothing_and_may_log_in_again(service):
    client = service(access=TOKENS.model_copy(update={"session_s": 1.0}))
    log_in(client, OPERATOR)
    mission = create_with(client)
    with client.websocket_connect(f"{WS}{API}/missions/{mission}/events", headers=OWN_PAGE) as events:
        secret = client.cookies[COOKIE]
        time.sleep(1.1)
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


def create_with(client) -> str:
    return client.post(f"{API}/missions", json={"preset": "quick"}, headers=OWN_PAGE).json()["id"]


def test_a_session_outlives_a_restart(service):
    client = service(access=TOKENS)
    log_in(client, VIEWER)
    secret = client.cookies[COOKIE]
    again = service(access=TOKENS)
    assert again.get(f"{API}/system", headers={"Cookie": f"{COOKIE}={secret}"}).status_code == 200


# --- other websites --------------------------------------------------------------------------------------


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


# --- limits ----------------------------------------------------------------------------------------------


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


# --- what is remembered ----------------------------------------------------------------------------------


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
