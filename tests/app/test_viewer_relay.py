"""The 3D scene behind the service: who may look, and what reaches viser."""

import httpx
import msgspec
import pytest
import viser
from viser import _messages
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.api.viewer import ALLOWED, read_message
from app.security.principal import Role
from app.settings import AccessSettings, DisplaySettings, Settings
from app.viewer.scenes import MOST_OPEN
from tests.app.conftest import wait_until
from tests.app.fake_mission import runner
from tests.app.live_service import serving

OPERATOR = "the operator's token, long enough"
VIEWER = "the viewer's token, long enough"
PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    settings = Settings(
        data_dir=tmp_path_factory.mktemp("relay") / "data",
        mission_threads=1,
        display=DisplaySettings(interval_s=0.05, max_splats=2_000),
        access=AccessSettings(operator_token=OPERATOR, viewer_token=VIEWER),
    )
    with serving(settings, runner=runner("run_short")) as service:
        yield service


@pytest.fixture(scope="module")
def missions(live):
    """Missions that have ended, each with a last view."""
    made = []
    with httpx.Client(base_url=f"{live.url}api/v1", headers=bearer(OPERATOR), timeout=30) as client:
        for seed in range(MOST_OPEN + 1):
            made.append(client.post("/missions", json={"preset": "quick", "seed": seed}).json()["id"])
            client.post(f"/missions/{made[-1]}/start")
        for mission in made:
            wait_until(lambda m=mission: client.get(f"/missions/{m}").json()["state"] == "completed")
    return made


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def look(live, mission: str, token: str | None = OPERATOR, **options):
    headers = {**(bearer(token) if token else {}), **options.pop("headers", {})}
    return connect(
        f"ws://127.0.0.1:{live.port}/viewer/{mission}",
        subprotocols=[PROTOCOL],
        additional_headers=headers,
        max_size=None,
        **options,
    )


def server_of(live, mission: str):
    return live.app.state.scenes._open[mission].server


def send(scene, kind: str, **content) -> None:
    scene.send(msgspec.msgpack.encode({"type": kind, **content}))


def test_whoever_may_look_is_sent_the_scene_of_the_mission(live, missions):
    for token in (OPERATOR, VIEWER):
        with look(live, missions[0], token) as scene:
            assert scene.subprotocol == PROTOCOL
            assert len(scene.recv(timeout=30)) > 100
            wait_until(lambda: live.app.state.scenes._open[missions[0]]._shown is not None)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        (bearer("a guess"), 401),
        ({**bearer(OPERATOR), "Origin": "https://evil.example"}, 403),
        ({**bearer(OPERATOR), "Origin": "null"}, 403),
        ({"X-HGS-Proof": "guess"}, 401),
    ],
)
def test_strangers_are_not(live, missions, headers, status):
    with pytest.raises(InvalidStatus) as refusal, look(live, missions[0], None, headers=headers):
        pass
    assert refusal.value.response.status_code == status
    if status == 401:
        assert httpx.get(f"{live.url}viewer/{missions[0]}/", headers=headers).status_code == 401


def test_the_port_of_viser_itself_answers_nobody(live, missions):
    with look(live, missions[0]):
        port = server_of(live, missions[0]).get_port()
        for headers in ({}, bearer(OPERATOR), {"Origin": live.url.rstrip("/")}):
            assert httpx.get(f"http://127.0.0.1:{port}/", headers=headers).status_code == 403
            with (
                pytest.raises(InvalidStatus),
                connect(f"ws://127.0.0.1:{port}/", subprotocols=[PROTOCOL], additional_headers=headers),
            ):
                pass


@pytest.mark.parametrize("token", [OPERATOR, VIEWER])
def test_nothing_but_looking_reaches_viser_and_sharing_never_does(live, missions, token, monkeypatch):
    opened, reached = [], []
    monkeypatch.setattr(viser._viser, "ViserTunnel", lambda *a, **k: opened.append(a))
    with look(live, missions[0], token) as scene:
        scene.recv(timeout=30)
        sockets = server_of(live, missions[0])._websock_server
        handle = sockets._handle_incoming_message

        async def note(client_id, message):
            reached.append(type(message).__name__)
            await handle(client_id, message)

        monkeypatch.setattr(sockets, "_handle_incoming_message", note)
        for kind in ("ShareUrlRequest", "ShareUrlDisconnect", "RunJavascriptMessage", "NoSuchMessage"):
            send(scene, kind)
        scene.send(b"\xff\x00 not msgpack")
        scene.send("text")
        scene.send(msgspec.msgpack.encode(["ShareUrlRequest"]))
        send(scene, "GuiUpdateMessage", uuid="none", updates={})
        camera = {
            "wxyz": (1.0, 0.0, 0.0, 0.0),
            "position": (0.0, 0.0, 1.0),
            "fov": 1.0,
            "near": 0.1,
            "far": 100.0,
            "image_height": 10,
            "image_width": 10,
            "look_at": (0.0, 0.0, 0.0),
            "up_direction": (0.0, 0.0, 1.0),
        }
        # A map may name its kind twice: what is checked must be what viser reads.
        plain = msgspec.msgpack.encode({"type": "ViewerCameraMessage", **camera})
        share = msgspec.msgpack.encode({"type": "ShareUrlRequest"})
        assert (plain[0], share[0]) == (0x8A, 0x81)  # maps of ten entries and of one
        scene.send(b"\x8b" + plain[1:] + share[1:])
        scene.send(b"\x8b" + share[1:] + plain[1:])
        wait_until(lambda: "ViewerCameraMessage" in reached)
    assert set(reached) <= ALLOWED[Role.OPERATOR if token == OPERATOR else Role.VIEWER]
    assert ("GuiUpdateMessage" in reached) == (token == OPERATOR)
    assert opened == []
    assert server_of(live, missions[0])._share_tunnel is None


def test_every_kind_that_may_pass_is_one_of_visers_and_none_shares():
    kinds = set().union(*ALLOWED.values())
    assert all(hasattr(_messages, kind) for kind in kinds)
    assert not any("Share" in kind or "Javascript" in kind or "File" in kind for kind in kinds)
    for content in (None, b"", b"\xc1", b"\x93\x01", b"\x81" * 5000, b"\x81\xa4type\x01"):
        assert read_message(content)[0] not in kinds


def test_the_viewers_page_takes_no_orders_from_its_address(live, missions):
    """viser's client connects wherever `?websocket=` says, and runs what it is sent from there."""
    url = f"{live.url}viewer/{missions[0]}/"
    page = httpx.get(url, headers=bearer(VIEWER))
    assert page.status_code == 200
    assert "<html" in page.text
    answer = httpx.get(url, params={"websocket": "wss://evil.example"}, headers=bearer(VIEWER))
    assert (answer.status_code, answer.headers["location"]) == (303, f"/viewer/{missions[0]}/")
    connections = page.headers["content-security-policy"].partition("connect-src ")[2].partition(";")[0]
    assert connections.split() == [
        *("'self'", "blob:", "data:"),
        *(f"ws://127.0.0.1:{live.port}", f"wss://127.0.0.1:{live.port}"),
    ]


def test_what_is_not_there_is_not_found(live):
    for path in ("nothing", "nothing/"):
        answer = httpx.get(f"{live.url}viewer/{path}", headers=bearer(VIEWER), follow_redirects=True)
        assert answer.status_code == 404
    with pytest.raises(InvalidStatus), look(live, "nothing"):
        pass


def test_scenes_that_nobody_looks_at_make_room(live, missions):
    for mission in missions:
        with look(live, mission) as scene:
            scene.recv(timeout=30)
    scenes = live.app.state.scenes
    wait_until(lambda: not any(scenes._lookers.values()))
    assert len(scenes._open) <= MOST_OPEN
    assert set(scenes._lookers) == set(scenes._open)
    assert missions[-1] in scenes._open


def test_a_logout_closes_the_scene(live, missions):
    with httpx.Client(base_url=live.url, headers={"Origin": live.url.rstrip("/")}) as client:
        client.post("/api/v1/session", json={"token": VIEWER})
        cookie = {"Cookie": f"hgs_session={client.cookies['hgs_session']}", "Origin": live.url.rstrip("/")}
        with look(live, missions[0], None, headers=cookie) as scene:
            client.delete("/api/v1/session")
            for _ in scene:  # ends with 1001, "going away"
                pass
            assert scene.close_code == 1001
