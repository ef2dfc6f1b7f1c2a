"""Events as they come, over a WebSocket and as server-sent events, to readers of every kind."""

import contextlib
import json
import socket
import threading
import time

import httpx
import psutil
import pytest
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect

from app.missions.event_log import OTHERS_KEPT
from app.settings import LimitSettings, Settings
from tests.app.conftest import PATIENCE_S, wait_until
from tests.app.fake_mission import runner
from tests.app.live_service import serving

TOLD = 400
"""Events in a burst, more than memory holds."""
assert TOLD > OTHERS_KEPT


@pytest.fixture
def live(tmp_path):
    settings = Settings(
        data_dir=tmp_path / "data", viewer=False, mission_threads=1, limits=LimitSettings(send_s=5.0)
    )
    with serving(settings, runner=runner("run_long")) as service:
        yield service


def start(service) -> str:
    with httpx.Client(base_url=f"{service.url}api/v1") as client:
        mission = client.post("/missions", json={"preset": "quick"}).json()["id"]
        client.post(f"/missions/{mission}/start")
        deadline = time.monotonic() + PATIENCE_S
        while client.get(f"/missions/{mission}").json()["state"] != "running":
            assert time.monotonic() < deadline
            time.sleep(0.05)
    return mission


def sse(lines):
    """Events of a stream: `(id, kind of the stream's event, content)`."""
    found: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(": ")
            found[name] = value
        elif "data" in found:
            yield found.get("id"), found.get("event"), json.loads(found["data"])
            found = {}


def test_server_sent_events_go_on_after_the_last_event_id(live):
    mission = start(live)
    url = f"{live.url}api/v1/missions/{mission}/events/stream"
    with httpx.stream("GET", url, timeout=30) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        events = sse(answer.iter_lines())
        first = [next(events) for _ in range(8)]
    assert [int(number) for number, _, _ in first] == sorted({e["sequence"] for _, _, e in first})
    assert [e["state"] for _, _, e in first if e["kind"] == "state"][:2] == ["starting", "running"]
    last = int(first[-1][0])
    httpx.post(f"{live.url}api/v1/missions/{mission}/stop")
    states = []
    with httpx.stream("GET", url, headers={"Last-Event-ID": str(last)}, timeout=30) as answer:
        for number, kind, event in sse(answer.iter_lines()):
            assert kind is None
            assert int(number) > last
            if event["kind"] == "state":
                states.append(event["state"])
                if event["state"] == "aborted":
                    break
    assert list(dict.fromkeys(states)) == ["stopping", "aborted"]  # told again for every new reason
    # Of a mission that has ended, too; and what never was is a problem, not a stream.
    with httpx.stream("GET", url, params={"after": last}, timeout=30) as answer:
        assert next(sse(answer.iter_lines()))[2]["sequence"] > last
    unknown = httpx.get(url.replace(mission, "nothing"))
    assert (unknown.status_code, unknown.headers["content-type"]) == (404, "application/problem+json")
    assert httpx.get(url, headers={"Last-Event-ID": "soon"}).status_code == 422


def test_a_quiet_stream_says_that_it_is_alive(live):
    with httpx.Client(base_url=f"{live.url}api/v1") as client:
        mission = client.post("/missions", json={"preset": "quick"}).json()["id"]
    url = f"{live.url}api/v1/missions/{mission}/events/stream"
    with httpx.stream("GET", url, timeout=30) as answer:
        number, kind, event = next(sse(answer.iter_lines()))
    assert (number, kind, event["kind"], event["state"]) == (None, "alive", "alive", "created")


def test_fifty_readers_one_of_them_stalled_lose_no_state_and_cost_no_memory(live):
    """One reads nothing while thousands of events pass: nothing is kept for it, and it is let go."""
    mission = start(live)
    log = live.missions.get(mission).log
    stalled = socket.create_connection(("127.0.0.1", live.port))
    stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    path = f"/api/v1/missions/{mission}/events/stream"
    stalled.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\n\r\n".encode())
    seen: list[list[int]] = []

    def read() -> None:
        numbers: list[int] = []
        url = f"ws://127.0.0.1:{live.port}/api/v1/missions/{mission}/events"
        with connect(url, max_size=None, compression=None) as events:
            for message in events:
                event = json.loads(message)
                if event["kind"] == "notice" and "number" in event:
                    numbers.append(event["number"])
                    if event["number"] == TOLD - 1:
                        break
        seen.append(numbers)

    readers = [threading.Thread(target=read) for _ in range(49)]
    for reader in readers:
        reader.start()
    wait_until(lambda: live.app.state.streams.n_readers(live.missions.get(mission)) == 50)
    before = psutil.Process().memory_info().rss
    filler = "x" * 20_000  # 8 MB in all, more than sockets hold
    for number in range(TOLD):
        log.append({"kind": "notice", "number": number, "level": "info", "message": filler})
    for reader in readers:
        reader.join(PATIENCE_S)
    assert len(seen) == 49
    assert all(numbers == list(range(TOLD)) for numbers in seen)
    grown = psutil.Process().memory_info().rss - before
    assert grown < 64 * 2**20, f"{grown / 2**20:.0f} MiB more"
    assert len(log._others) <= OTHERS_KEPT
    # The stalled reader holds nothing but its place, and that for a stated time only.
    wait_until(lambda: live.app.state.streams.n_readers(live.missions.get(mission)) == 0)
    assert not log._wakers
    stalled.close()
    # It comes back and is told every state, and the events since.
    url = f"{live.url}api/v1/missions/{mission}/events/stream"
    with httpx.stream("GET", url, headers={"Last-Event-ID": "1"}, timeout=30) as answer:
        numbers = []
        for _, _, event in sse(answer.iter_lines()):
            if "number" in event:
                numbers.append(event["number"])
            if len(numbers) == TOLD:
                break
    assert numbers == list(range(TOLD))


def test_the_service_stops_promptly_with_open_streams(tmp_path):
    settings = Settings(data_dir=tmp_path / "data", viewer=False, mission_threads=1)
    ends = []
    with serving(settings, runner=runner("run_long")) as live:
        with httpx.Client(base_url=f"{live.url}api/v1") as client:
            mission = client.post("/missions", json={"preset": "quick"}).json()["id"]
        path = f"127.0.0.1:{live.port}/api/v1/missions/{mission}/events"

        def listen() -> None:
            with connect(f"ws://{path}") as events:
                with contextlib.suppress(ConnectionClosedError):  # 1012 is not one of the ordinary ends
                    for _ in events:
                        pass
                ends.append(events.close_code)

        def follow() -> None:
            with httpx.stream("GET", f"http://{path}/stream", timeout=60) as answer:
                for _ in answer.iter_lines():
                    pass
                ends.append("sse")

        threads = [threading.Thread(target=task) for task in (listen, follow)]
        for thread in threads:
            thread.start()
        wait_until(lambda: live.app.state.streams.n_readers(live.missions.get(mission)) == 2)
        began = time.monotonic()
    assert time.monotonic() - began < 5.0
    for thread in threads:
        thread.join(10)
    assert sorted(map(str, ends)) == ["1012", "sse"]
