"""Clients of the service in a process of their own: readers of events, one that stalls, and steady questions.

    python -m tests.app.load_client URL MISSION READERS REQUESTS_PER_S

runs until the mission has ended, and prints what was seen as one JSON object.
"""

from __future__ import annotations

import asyncio
import json
import socket
import sys
import time
from dataclasses import asdict, dataclass, field

import httpx
from websockets.asyncio.client import connect

ENDED = ("completed", "failed", "aborted")


@dataclass(kw_only=True)
class Seen:
    """What the clients saw."""

    states: list[list[str]] = field(default_factory=list)
    """Of each reader that was not stalled, in its order."""
    telemetry: list[int] = field(default_factory=list)
    request_s: list[float] = field(default_factory=list)
    """Of each question after the state of the mission [s]."""
    refused: int = 0


def note(states: list[str], state: str) -> bool:
    """Whether there is more to come. A state may be told again, for another reason."""
    if states[-1:] != [state]:
        states.append(state)
    return state not in ENDED


async def read_socket(url: str, mission: str, seen: Seen) -> None:
    path = f"{url.replace('http', 'ws', 1)}api/v1/missions/{mission}/events"
    states: list[str] = []
    n_telemetry = 0
    async with connect(path, compression=None, max_size=None, open_timeout=120) as events:
        async for message in events:
            event = json.loads(message)
            n_telemetry += event["kind"] == "telemetry"
            if event["kind"] == "state" and not note(states, event["state"]):
                break
    seen.states.append(states)
    seen.telemetry.append(n_telemetry)


async def read_stream(client: httpx.AsyncClient, mission: str, seen: Seen) -> None:
    states: list[str] = []
    n_telemetry = 0
    async with client.stream("GET", f"/missions/{mission}/events/stream") as answer:
        async for line in answer.aiter_lines():
            if not line.startswith("data: "):
                continue
            event = json.loads(line[6:])
            n_telemetry += event["kind"] == "telemetry"
            if event["kind"] == "state" and not note(states, event["state"]):
                break
    seen.states.append(states)
    seen.telemetry.append(n_telemetry)


async def ask(
    client: httpx.AsyncClient, mission: str, per_s: float, seen: Seen, ended: asyncio.Event
) -> None:
    """At fixed moments, however long answers take: a slow answer makes no question go unasked."""

    async def once() -> None:
        began = time.perf_counter()
        answer = await client.get(f"/missions/{mission}")
        seen.request_s.append(time.perf_counter() - began)
        seen.refused += answer.status_code != 200

    async with asyncio.TaskGroup() as group:
        begun, number = time.perf_counter(), 0
        while not ended.is_set():
            group.create_task(once())
            number += 1
            await asyncio.sleep(max(0.0, begun + number / per_s - time.perf_counter()))


def stall(url: httpx.URL, mission: str) -> socket.socket:
    """A reader that asks for events and takes in none."""
    reader = socket.create_connection((url.host, url.port))
    reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    path = f"/api/v1/missions/{mission}/events/stream"
    reader.sendall(f"GET {path} HTTP/1.1\r\nHost: {url.host}:{url.port}\r\n\r\n".encode())
    return reader


async def run(url: str, mission: str, readers: int, requests_per_s: float) -> Seen:
    seen, ended = Seen(), asyncio.Event()
    # Idle connections are let go sooner than the service does, which would race with the next question.
    limits = httpx.Limits(max_connections=None, keepalive_expiry=2.0)
    async with httpx.AsyncClient(base_url=f"{url}api/v1", timeout=120, limits=limits) as client:
        stalled = stall(httpx.URL(url), mission)
        reading = [
            read_socket(url, mission, seen) if number % 2 else read_stream(client, mission, seen)
            for number in range(readers - 1)
        ]
        asking = asyncio.create_task(ask(client, mission, requests_per_s, seen, ended))
        await asyncio.gather(*reading)
        ended.set()
        await asking
        stalled.close()
    return seen


if __name__ == "__main__":
    found = asyncio.run(run(sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])))
    json.dump(asdict(found), sys.stdout)
