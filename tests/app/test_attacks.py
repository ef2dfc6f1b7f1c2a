"""Clients that do not play by the rules, on real connections: slow, silent, too many, not speaking HTTP."""

import contextlib
import socket
import struct
import time

import httpx
import psutil
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from app.settings import AccessSettings, LimitSettings, Settings
from tests.app.conftest import wait_until
from tests.app.fake_mission import runner
from tests.app.live_service import serving

OPERATOR = "the operator's token, long enough"
BEARER = {"Authorization": f"Bearer {OPERATOR}"}
LIMITS = LimitSettings(header_s=2.0, body_s=2.0, send_s=2.0, connections=40)


@pytest.fixture
def live(tmp_path):
    settings = Settings(
        data_dir=tmp_path / "data",
        viewer=False,
        mission_threads=1,
        limits=LIMITS,
        access=AccessSettings(operator_token=OPERATOR),
    )
    with serving(settings, runner=runner("run_long")) as service:
        yield service


def dial(live) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", live.port), timeout=30)
    connection.settimeout(30)
    return connection


def held_connections(live) -> int:
    """Connections of clients that the service holds."""
    return len([c for c in psutil.Process().net_connections("tcp") if c.laddr.port == live.port and c.raddr])


def closed_after(connection: socket.socket) -> float:
    """Wait until the service hangs up; how long that took [s]."""
    began = time.monotonic()
    with contextlib.suppress(ConnectionResetError, BrokenPipeError):
        while connection.recv(65536):
            pass
    return time.monotonic() - began


def stop_takes(live, mission: str) -> float:
    began = time.monotonic()
    answer = httpx.post(f"{live.url}api/v1/missions/{mission}/stop", headers=BEARER, timeout=30)
    assert answer.status_code == 202
    return time.monotonic() - began


def new_mission(live) -> str:
    answer = httpx.post(f"{live.url}api/v1/missions", json={"preset": "quick"}, headers=BEARER, timeout=30)
    return answer.json()["id"]


@pytest.mark.parametrize("head", [b"", b"\r\n", b"G", b"GET / HTTP/1.1\r\nHost: localhost\r\nX-A: "])
def test_a_head_that_does_not_come_ends_the_connection(live, head):
    with dial(live) as connection:
        connection.sendall(head)
        assert closed_after(connection) < 10 * LIMITS.header_s


def test_a_head_that_comes_a_byte_at_a_time_ends_the_connection(live):
    with dial(live) as connection:
        began = time.monotonic()
        with contextlib.suppress(ConnectionResetError, BrokenPipeError):
            for byte in b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X-Filler: 1\r\n" * 500:
                connection.sendall(bytes([byte]))
                time.sleep(0.05)
        assert time.monotonic() - began < 10 * LIMITS.header_s


def test_hundreds_of_slow_connections_do_not_keep_the_operator_from_stop(live):
    mission = new_mission(live)
    slow = []
    for _ in range(300):
        connection = dial(live)
        connection.sendall(b"POST /api/v1/missions HTTP/1.1\r\nHost: ")
        slow.append(connection)
    assert stop_takes(live, mission) < 5.0
    assert held_connections(live) < 300
    wait_until(lambda: held_connections(live) <= LIMITS.connections)
    for connection in slow:
        assert closed_after(connection) < 20
        connection.close()


@pytest.mark.parametrize("size", ["Content-Length: 100000", "Transfer-Encoding: chunked"])
def test_a_body_that_does_not_come_is_given_up(live, size):
    with dial(live) as connection:
        head = f"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {OPERATOR}\r\n"
        connection.sendall(f"{head}Content-Type: application/json\r\n{size}\r\n\r\n".encode())
        connection.sendall(b"1\r\n{\r\n" if "chunked" in size else b"{")
        began = time.monotonic()
        answer = connection.recv(65536)
        assert time.monotonic() - began < 10 * LIMITS.body_s
        assert answer.startswith(b"HTTP/1.1 408")
        assert b"application/problem+json" in answer
    assert live.missions.page(10) == []


def test_without_a_token_no_body_is_waited_for(live):
    with dial(live) as connection:
        connection.sendall(
            b"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\n{"
        )
        began = time.monotonic()
        assert connection.recv(65536).startswith(b"HTTP/1.1 401")
        assert time.monotonic() - began < LIMITS.body_s


def test_a_reader_that_stalls_during_a_download_is_let_go(live):
    mission = new_mission(live)
    folder = live.missions.get(mission).results_dir
    folder.mkdir(parents=True)
    (folder / "map.ply").write_bytes(bytes(64 * 2**20))
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", live.port))
        path = f"/api/v1/missions/{mission}/results/map.ply"
        connection.sendall(
            f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {OPERATOR}\r\n\r\n".encode()
        )
        wait_until(lambda: held_connections(live) == 1)
        wait_until(lambda: held_connections(live) == 0)
    # One that reads, if slowly, gets all of it.
    with httpx.stream("GET", f"{live.url}{path[1:]}", headers=BEARER, timeout=60) as answer:
        assert sum(len(part) for part in answer.iter_bytes()) == 64 * 2**20


@pytest.mark.parametrize(
    "request_",
    [
        b"\x00\xff\xfe nonsense\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n",
        b"GET http://evil.example/ HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        b"GET /../../../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /%2e%2e/%2e%2e/pyproject.toml HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /js/..%2f..%2fpyproject.toml HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /api/v1/%00 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET //api/v1/missions HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /API/v1/missions HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /x/../api/v1/missions HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /%61pi/v1/missions HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"POST /api/v1/missions HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\n"
        b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\nGET /api/v1/audit HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"x" * 200_000 + b"\r\n\r\n",
    ],
)
def test_requests_that_are_none_let_nobody_in_and_break_nothing(live, request_):
    with dial(live) as connection:
        connection.sendall(request_)
        connection.settimeout(5)
        answer = b""
        with contextlib.suppress(TimeoutError, ConnectionResetError, BrokenPipeError):
            while part := connection.recv(65536):
                answer += part
    status = answer.split(b" ", 2)[1] if answer.startswith(b"HTTP/") else b"closed"
    assert status in (b"closed", b"400", b"401", b"403", b"404", b"422", b"431"), answer[:300]
    assert b'"missions"' not in answer
    assert b"[project]" not in answer
    assert httpx.get(f"{live.url}healthz").status_code == 200


def test_a_head_without_end_is_cut_off_early(live):
    """The parser would collect it all, as fast as the network is."""
    sent = 0
    with dial(live) as connection, contextlib.suppress(ConnectionResetError, BrokenPipeError):
        connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX: ")
        while sent < 256 * 2**20:
            connection.sendall(b"x" * 65536)
            sent += 65536
    assert sent < 32 * 2**20  # what fits the buffers of both ends


def header_of_binary_message(n_bytes: int) -> bytes:
    """RFC 6455, section 5.2: final, binary, masked, eight bytes of length."""
    return struct.pack("!BBQ4x", 0x82, 0x80 | 127, n_bytes)


def test_a_stream_takes_no_floods_from_its_reader(live):
    """Whatever a listener sends is dropped, and what is too large ends its stream."""
    mission = new_mission(live)
    url = f"ws://127.0.0.1:{live.port}/api/v1/missions/{mission}/events"
    with connect(url, additional_headers=BEARER) as events:
        for _ in range(200):
            events.send(b"x" * 10_000)
        assert "alive" in events.recv(timeout=30)
        # Its header is enough: who sends all of it may be cut off before the reason has come.
        events.socket.sendall(header_of_binary_message(LIMITS.message_bytes + 1))
        with contextlib.suppress(ConnectionClosed):
            for _ in events:
                pass
    assert events.close_code == 1009
    assert httpx.get(f"{live.url}healthz").status_code == 200
