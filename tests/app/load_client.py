"""Clients of the service in a process of their own: readers of events, one that stalls, and steady questions.

    python -m tests.app.load_client URL MISSION READERS REQUESTS_PER_S

runs until the mission has ended, and prints what was seen as one JSON object. It shares the processor with
what it measures, so it does little: bare HTTP, and of an event no more than its kind is looked at.
"""

from __future__ import annotations

import asyncio
import json
import re
import socket
import sys
import time
from collections.abc import AsyncIterator
from dataclasses import asdict, dataclass, field
from urllib.parse import urlsplit

from websockets.asyncio.client import connect

ENDED = ("completed", "failed", "aborted")
_KIND = re.compile(rb'"kind": ?"([a-z_]+)"')
_LENGTH = re.compile(rb"\r\ncontent-length: *(\d+)", re.IGNORECASE)


@dataclass(kw_only=True)
class Seen:
    """What the clients saw."""

    states: list[list[str]] = field(default_factory=list)
    """Of each reader that was not stalled, in its order."""
    telemetry: list[int] = field(default_factory=list)
    request_s: list[float] = field(default_factory=list)
    """Of each question after the state of the mission [s]."""
    refused: int = 0
    processor_s: float = 0.0
    """What these clients took themselves [s]."""


class Reader:
    """What one reader of events has seen."""

    def __init__(self) -> None:
        self.states: list[str] = []
        self.n_telemetry = 0

    def take(self, message: bytes) -> bool:
        """Whether there is more to come. A state may be told again, for another reason."""
        found = _KIND.search(message)
        assert found is not None, message[:200]
        self.n_telemetry += found[1] == b"telemetry"
        if found[1] != b"state":
            return True
        state = json.loads(message)["state"]
        if self.states[-1:] != [state]:
            self.states.append(state)
        return state not in ENDED


class Bare:
    """HTTP/1.1 to one address."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        assert parts.hostname is not None
        assert parts.port is not None
        self.address = parts.hostname, parts.port
        self._idle: list[tuple[asyncio.StreamReader, asyncio.StreamWriter, float]] = []

    def head(self, path: str) -> bytes:
        return f"GET {path} HTTP/1.1\r\nHost: {self.address[0]}:{self.address[1]}\r\n\r\n".encode()

    async def get(self, path: str) -> int:
        """The status of the answer, once all of it is here."""
        reader, writer = await self._connection()
        writer.write(self.head(path))
        head = await reader.readuntil(b"\r\n\r\n")
        length = _LENGTH.search(head)
        assert length is not None, head
        await reader.readexactly(int(length[1]))
        self._idle.append((reader, writer, time.monotonic()))
        return int(head.split(b" ", 2)[1])

    async def lines(self, path: str) -> AsyncIterator[bytes]:
        """Of an answer without end; where its chunks begin and end are lines that mean nothing here."""
        reader, writer = await asyncio.open_connection(*self.address, limit=2**24)
        writer.write(self.head(path))
        try:
            while line := await reader.readline():
                yield line
        finally:
            writer.close()

    async def _connection(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        while self._idle:
            reader, writer, since = self._idle.pop()
            # Let go sooner than the service does it, which would race with the next question.
            if time.monotonic() - since < 2.0:
                return reader, writer
            writer.close()
        return await asyncio.open_connection(*self.address, limit=2**20)


async def read_socket(url: str, mission: str, seen: Seen) -> None:
    path = f"{url.replace('http', 'ws', 1)}api/v1/missions/{mission}/events"
    reader = Reader()
    async with connect(path, compression=None, max_size=None, open_timeout=120) as events:
        while reader.take(await events.recv(decode=False)):
            pass
    seen.states.append(reader.states)
    seen.telemetry.append(reader.n_telemetry)


async def read_stream(http: Bare, mission: str, seen: Seen) -> None:
    reader = Reader()
    async for line in http.lines(f"/api/v1/missions/{mission}/events/stream"):
        if line.startswith(b"data: ") and not reader.take(line[6:]):
            break
    seen.states.append(reader.states)
    seen.telemetry.append(reader.n_telemetry)


async def ask(http: Bare, mission: str, per_s: float, seen: Seen, ended: asyncio.Event) -> None:
    """At fixed moments, however long answers take: a slow answer makes no question go unasked."""

    async def once() -> None:
        began = time.perf_counter()
        status = await http.get(f"/api/v1/missions/{mission}")
        seen.request_s.append(time.perf_counter() - began)
        seen.refused += status != 200

    async with asyncio.TaskGroup() as group:
        begun, number = time.perf_counter(), 0
        while not ended.is_set():
            group.create_task(once())
            number += 1
            await asyncio.sleep(max(0.0, begun + number / per_s - time.perf_counter()))


def stall(http: Bare, mission: str) -> socket.socket:
    """A reader that asks for events and takes in none."""
    reader = socket.create_connection(http.address)
    reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    reader.sendall(http.head(f"/api/v1/missions/{mission}/events/stream"))
    return reader


async def run(url: str, mission: str, readers: int, requests_per_s: float) -> Seen:
    seen, ended, http = Seen(), asyncio.Event(), Bare(url)
    began_s = time.process_time()
    stalled = stall(http, mission)
    reading = [
        read_socket(url, mission, seen) if number % 2 else read_stream(http, mission, seen)
        for number in range(readers - 1)
    ]
    asking = asyncio.create_task(ask(http, mission, requests_per_s, seen, ended))
    await asyncio.gather(*reading)
    ended.set()
    await asking
    stalled.close()
    seen.processor_s = time.process_time() - began_s
    return seen


if __name__ == "__main__":
    found = asyncio.run(run(sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])))
    json.dump(asdict(found), sys.stdout)
