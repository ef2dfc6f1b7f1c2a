"""The way in for robots, on a real port: a mission over it, and everything that may go wrong on the way."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from app.security.principal import Role
from app.security.tokens import new_token
from app.settings import AccessSettings, Settings
from hgs_core.live.messages import End, Refusal, Stop, Welcome, encoded, to_robot
from tests.app.live_service import LiveService, serving
from tests.live.far_robot import FarRobot, far_config
from tests.live.test_messages import HELLO, changed, frame
from tests.mission.small_room import write_small_room

OPERATOR = "an operator of twenty and more"
OVERRIDES = {"sensor": "rgbd_5m_tiny", "mesh.enabled": "false", "live.dead_man_s": "1"}
PATIENCE_S = 90.0


@pytest.fixture(scope="module")
def secrets(tmp_path_factory) -> dict[str, str]:
    made = {role: new_token(role, f"the {role}".replace(" ", "-")) for role in (Role.VIEWER, Role.ROBOT)}
    path = tmp_path_factory.mktemp("tokens") / "tokens"
    path.write_text("\n".join(token.line for _, token in made.values()))
    return {
        "file": str(path),
        "operator": OPERATOR,
        **{str(role): secret for role, (secret, _) in made.items()},
    }


@pytest.fixture(scope="module")
def service(tmp_path_factory, secrets) -> Iterator[LiveService]:
    settings = Settings(
        data_dir=tmp_path_factory.mktemp("ingest"),
        mission_threads=1,
        viewer=False,
        access=AccessSettings(operator_token=OPERATOR, token_file=Path(secrets["file"])),
    )
    with serving(settings) as served:
        yield served


@pytest.fixture(scope="module")
def api(service) -> Iterator[httpx.Client]:
    headers = {"Authorization": f"Bearer {OPERATOR}"}
    with httpx.Client(base_url=f"{service.url}api/v1", headers=headers, timeout=60) as client:
        yield client


@contextmanager
def connected(service: LiveService, mission: str, secret: str = OPERATOR) -> Iterator[ClientConnection]:
    url = f"ws://127.0.0.1:{service.port}/api/v1/ingest/{mission}"
    headers = {"Authorization": f"Bearer {secret}"}
    with connect(url, additional_headers=headers, max_size=None, compression=None) as websocket:
        yield websocket


def ordered(api: httpx.Client, **wish) -> str:
    order = {"scene": "live", "preset": "quick", "overrides": OVERRIDES, **wish}
    return api.post("/missions", json=order).raise_for_status().json()["id"]


def wait_for(so, what: str) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not so():
        assert time.monotonic() < deadline, what
        time.sleep(0.1)


def closing_code(websocket: ClientConnection) -> tuple[int, str]:
    try:
        while True:
            websocket.recv(timeout=PATIENCE_S)
    except ConnectionClosed as closed:
        return (0, "") if closed.rcvd is None else (closed.rcvd.code, closed.rcvd.reason)


def test_a_robot_is_driven_through_the_service(service, api, tmp_path) -> None:
    """It connects too early, drives, is stopped by the operator, and is let go."""
    mission = ordered(api)
    with connected(service, mission) as early:
        code, reason = closing_code(early)
        assert (code, "start" in reason) == (4410, True)
    api.post(f"/missions/{mission}/start").raise_for_status()
    with connected(service, mission) as websocket:
        robot = FarRobot(far_config(), write_small_room(tmp_path), websocket.send)
        ended: list[str] = []
        ear = threading.Thread(target=lambda: listen(websocket, robot, ended), daemon=True)
        ear.start()
        robot.begin()
        wait_for(lambda: robot.world.robot.state.path_length_m > 0.2, "it drives")
        seen = api.get(f"/missions/{mission}/robot").raise_for_status().json()
        assert seen["connected"]
        assert seen["robot"] == "far robot"
        assert seen["command"]["type"] in ("path", "stop")
        assert seen["frames"] > 0
        api.post(f"/missions/{mission}/stop").raise_for_status()
        wait_for(lambda: robot.ended is not None, "it is told that the mission is over")
        assert robot.world.robot.arrived
        robot.close()
        wait_for(lambda: api.get(f"/missions/{mission}").json()["state"] == "aborted", "it has ended")
        ear.join(PATIENCE_S)
    state = api.get(f"/missions/{mission}").json()
    assert state["stop_reason"] == "interrupted"
    assert state["figures"]["collisions"] == 0
    assert api.get(f"/missions/{mission}/results/map.ply").status_code == 200


def listen(websocket: ClientConnection, robot: FarRobot, ended: list[str]) -> None:
    try:
        while True:
            content = websocket.recv()
            assert isinstance(content, bytes)
            robot.hear(content)
    except ConnectionClosed as closed:
        ended.append(str(closed))


def test_what_breaks_the_protocol_is_refused_and_harms_nobody(service, api) -> None:
    mission = ordered(api)
    api.post(f"/missions/{mission}/start").raise_for_status()
    with connected(service, mission) as websocket:
        for content in (b"noise", "text", encoded(frame()), encoded(changed(HELLO, protocol=9)), b""):
            websocket.send(content)
            refusal = to_robot(websocket.recv(timeout=PATIENCE_S))
            # A frame gets its credit back.
            assert isinstance(refusal, Refusal) or refusal.fate == "refused", content
        websocket.send(encoded(HELLO))
        while not isinstance(message := to_robot(websocket.recv(timeout=PATIENCE_S)), Welcome):
            assert isinstance(message, Refusal)
        assert message.mission == mission
        with connected(service, mission) as another:
            another.send(encoded(HELLO))
            assert closing_code(websocket)[0] == 4409
            assert isinstance(until(another, Welcome), Welcome)
            api.post(f"/missions/{mission}/stop").raise_for_status()
            assert isinstance(until(another, Stop), Stop)
            assert closing_code(another)[0] == 4410
    wait_for(lambda: api.get(f"/missions/{mission}").json()["state"] == "aborted", "it was stopped before")
    refused = api.get(f"/missions/{mission}").json()["reason"]
    assert "waited for a frame" in refused


def until(websocket: ClientConnection, kind: type):
    while not isinstance(message := to_robot(websocket.recv(timeout=PATIENCE_S)), kind):
        assert not isinstance(message, End)
    return message


def test_only_robots_and_operators_get_in(service, api, secrets) -> None:
    mission = ordered(api, scene="house")
    for secret, status in ((secrets["viewer"], 403), ("somebody else's secret", 401)):
        with pytest.raises(InvalidStatus) as refused, connected(service, mission, secret):
            pass
        assert refused.value.response.status_code == status
    with connected(service, mission, secrets["robot"]) as websocket:
        code, reason = closing_code(websocket)
        assert (code, "live" in reason) == (4411, True)
    with connected(service, "20200101-000000-0123456789ab", secrets["robot"]) as websocket:
        assert closing_code(websocket)[0] == 4404
    robot = {"Authorization": f"Bearer {secrets['robot']}"}
    for path in ("/missions", f"/missions/{mission}", "/scenes"):
        assert httpx.get(f"{service.url}api/v1{path}", headers=robot).status_code == 403
    assert httpx.post(f"{service.url}api/v1/missions/{mission}/stop", headers=robot).status_code == 403
