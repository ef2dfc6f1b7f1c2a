"""A line between a robot and its service on which things go wrong, when a test says so."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any, Final

import httpx
import msgspec
import numpy as np
from websockets.asyncio.client import connect
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.http11 import Request, Response

OVERSIZED_BYTES: Final = 5 * 2**20
"""More than the service takes in one message."""


class BadLine:
    """Relays to the service at `port`; what it does to the robot's messages is set from outside."""

    def __init__(self, port: int, rng: np.random.Generator) -> None:
        self._service_port = port
        self._rng = rng
        self.port = 0
        self.cut_until = 0.0
        """Until then (monotonic) there is no connection."""
        self.clock_s = 0.0
        """Added to the times that the robot's messages bear."""
        self.shares: dict[str, float] = {}
        """Of the robot's messages that are `duplicated`, `reordered`, `corrupted`, `oversized`, `nan`."""
        self.done: dict[str, int] = {}
        """How often each was done."""
        self._loop = asyncio.new_event_loop()
        self._open: set[ServerConnection] = set()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def cut(self, duration_s: float) -> None:
        self.cut_until = time.monotonic() + duration_s
        self._loop.call_soon_threadsafe(lambda: [robot.transport.abort() for robot in self._open])

    @contextmanager
    def up(self) -> Iterator[BadLine]:
        begun = threading.Event()
        stopping = asyncio.Event()

        async def run() -> None:
            options: dict[str, Any] = {"max_size": None, "compression": None}
            async with serve(self._relay, "127.0.0.1", 0, process_request=self._answer, **options) as server:
                self.port = server.sockets[0].getsockname()[1]
                begun.set()
                await stopping.wait()

        thread = threading.Thread(target=lambda: self._loop.run_until_complete(run()), daemon=True)
        thread.start()
        begun.wait()
        try:
            yield self
        finally:
            self._loop.call_soon_threadsafe(stopping.set)
            thread.join(30)

    async def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """No connection while the line is cut; what is no WebSocket is fetched."""
        if time.monotonic() < self.cut_until:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "the line is cut\n")
        if "upgrade" in request.headers:
            return None
        try:
            async with httpx.AsyncClient(timeout=60) as client:
                found = await client.get(f"http://127.0.0.1:{self._service_port}{request.path}")
        except httpx.TransportError as error:
            return connection.respond(HTTPStatus.BAD_GATEWAY, str(error))
        kind, length = found.headers.get("content-type", ""), str(len(found.content))
        headers = Headers({"Content-Type": kind, "Content-Length": length, "Connection": "close"})
        return Response(found.status_code, found.reason_phrase, headers, found.content)

    async def _relay(self, robot: ServerConnection) -> None:
        assert robot.request is not None
        url = f"ws://127.0.0.1:{self._service_port}{robot.request.path}"
        self._open.add(robot)
        try:
            async with connect(url, max_size=None, compression=None) as service:
                there = asyncio.create_task(self._to_service(robot, service))
                back = asyncio.create_task(_pass_on(service, robot))
                await asyncio.wait({there, back}, return_when=asyncio.FIRST_COMPLETED)
                for task in (there, back):
                    task.cancel()
                if service.close_code is not None:
                    await robot.close(_code(service.close_code), service.close_reason or "")
        except (OSError, InvalidStatus, ConnectionClosed):
            robot.transport.abort()
        finally:
            self._open.discard(robot)

    async def _to_service(self, robot: ServerConnection, service: Any) -> None:
        kept: bytes | str | None = None
        try:
            async for content in robot:
                for changed in self._spoilt(content):
                    await service.send(changed)
                    if kept is not None:
                        await service.send(kept)
                        kept = None
                if kept is None and self._falls("reordered"):
                    kept = content
        except ConnectionClosed:
            return

    def _spoilt(self, content: bytes | str) -> list[bytes | str]:
        """What is sent in its place."""
        assert isinstance(content, bytes)
        if self.clock_s or self._falls("nan"):
            message = msgspec.msgpack.decode(content)
            if "time_s" in message:
                message["time_s"] += self.clock_s
            if message.get("pose") is not None and self.shares.get("nan"):
                message["pose"][3] = float("nan")
            content = msgspec.msgpack.encode(message)
        if self._falls("corrupted"):
            torn = bytearray(content)
            for place in self._rng.integers(0, len(torn), 1 + len(torn) // 500):
                torn[place] ^= int(self._rng.integers(1, 256))
            content = bytes(torn)
        sent: list[bytes | str] = [content]
        if self._falls("duplicated"):
            sent.append(content)
        if self._falls("oversized"):
            sent.append(bytes(OVERSIZED_BYTES))
        return sent

    def _falls(self, what: str) -> bool:
        share = self.shares.get(what, 0.0)
        if share == 0.0 or self._rng.uniform() >= share:
            return False
        self.done[what] = self.done.get(what, 0) + 1
        return True


async def _pass_on(service: Any, robot: ServerConnection) -> None:
    try:
        async for content in service:
            await robot.send(content)
    except ConnectionClosed:
        return


def _code(code: int) -> int:
    """Codes that say how a connection broke cannot be sent."""
    return 1011 if code in (1005, 1006, 1015) else code
