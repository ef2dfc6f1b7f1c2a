"""A service that speaks the protocol and does what a test says, on a real port of the loopback address."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import ServerConnection, serve

from hgs_core.errors import StreamError
from hgs_core.live.checks import MessageChecks
from hgs_core.live.messages import (
    Ack,
    Answer,
    Bye,
    End,
    FollowPath,
    Frame,
    FromRobot,
    Heartbeat,
    Hello,
    Report,
    ToRobot,
    Welcome,
    encoded,
    from_robot,
)
from tests.app.robot.own_loop import PATIENCE_S, OwnLoop


class FakeService:
    """Welcomes every robot, answers every frame, and keeps what it was told."""

    def __init__(self, *, dead_man_s: float = 10.0, credits: int = 3) -> None:
        self.dead_man_s = dead_man_s
        self.credits = credits
        self.heartbeats = True
        self.answers = True
        self.deaf_to_hellos = 0
        """So many hellos are still to be lost on their way."""
        self.refuse_with: int | None = None
        """An HTTP status with which connections are refused."""
        self.connections = 0
        self.received: list[FromRobot] = []
        self.refused: list[str] = []
        self.on_their_way = 0
        self.most_on_their_way = 0
        self.port = 0
        self._socket: ServerConnection | None = None
        self._own = OwnLoop()

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.port}/api/v1/ingest/m1"

    def now_s(self) -> float:
        """A clock that has nothing to do with the robot's."""
        return time.monotonic() - 12_345.0

    def of(self, kind: type) -> list[Any]:
        return [message for message in list(self.received) if isinstance(message, kind)]

    @property
    def report(self) -> Report:
        """The newest."""
        return self.of(Report)[-1]

    def wait_for(self, condition: Callable[[], Any]) -> Any:
        deadline = time.monotonic() + PATIENCE_S
        while not (found := condition()):
            assert time.monotonic() < deadline, self.refused
            time.sleep(0.01)
        return found

    def say(self, *messages: ToRobot | bytes | str) -> None:
        """In one breath."""
        self._own.call(self._send([m if isinstance(m, bytes | str) else encoded(m) for m in messages]))

    def cut(self) -> None:
        """As when the cable is pulled and the system notices: no goodbye."""

        async def abort() -> None:
            assert self._socket is not None
            self._socket.transport.abort()

        self._own.call(abort())

    def close_with(self, code: int) -> None:
        async def close() -> None:
            assert self._socket is not None
            await self._socket.close(code, "as the test wants it")

        self._own.call(close())

    def path(
        self,
        command: int,
        positions_m: list[list[float]],
        *,
        yaws_rad: list[float | None] | None = None,
        late_s: float = 0.0,
    ) -> FollowPath:
        return FollowPath(
            now_s=self.now_s() - late_s,
            command=command,
            valid_for_s=20.0,
            positions_m=positions_m,
            yaws_rad=yaws_rad or [None] * len(positions_m),
            headings_rad=None,
            timed={},
        )

    def ack(self, command: int) -> Ack:
        """The robot's answer to a command, once it is there."""
        return self.wait_for(lambda: [ack for ack in self.of(Ack) if ack.command == command])[-1]

    def end(self) -> None:
        self.say(self.ending())

    def ending(self) -> End:
        return End(now_s=self.now_s(), reason="all was seen")

    # On the service's own thread.

    async def _send(self, contents: list[bytes | str]) -> None:
        assert self._socket is not None
        for content in contents:
            await self._socket.send(content)

    async def _serve(self, socket: ServerConnection) -> None:
        checks = MessageChecks()
        beating = asyncio.create_task(self._beat(socket))
        try:
            async for content in socket:
                assert isinstance(content, bytes)
                message = from_robot(content)
                if isinstance(message, Hello) and self.deaf_to_hellos > 0:
                    self.deaf_to_hellos -= 1
                    self._socket = socket
                    continue
                try:
                    checks.admit(message)
                except StreamError as error:
                    self.refused.append(str(error))
                    if isinstance(message, Frame):
                        await self._answer(socket, message, "refused", str(error))
                    continue
                self.received.append(message)
                if isinstance(message, Hello):
                    self.connections += 1
                    self.on_their_way = 0
                    self._socket = socket
                    await socket.send(
                        encoded(
                            Welcome(
                                protocol=1,
                                mission="m1",
                                now_s=self.now_s(),
                                dead_man_s=self.dead_man_s,
                                credits=self.credits,
                            )
                        )
                    )
                elif isinstance(message, Frame):
                    self.on_their_way += 1
                    self.most_on_their_way = max(self.most_on_their_way, self.on_their_way)
                    if self.answers:
                        await self._answer(socket, message, "taken", "")
                elif isinstance(message, Bye):
                    await socket.send(encoded(End(now_s=self.now_s(), reason="the stream is over")))
        finally:
            beating.cancel()

    async def _answer(self, socket: ServerConnection, frame: Frame, fate: Any, reason: str) -> None:
        self.on_their_way -= fate == "taken"
        answer = Answer(now_s=self.now_s(), sequence=frame.sequence, fate=fate, reason=reason)
        await socket.send(encoded(answer))

    async def _beat(self, socket: ServerConnection) -> None:
        while True:
            await asyncio.sleep(0.05)
            if self.heartbeats and socket is self._socket:
                await socket.send(encoded(Heartbeat(now_s=self.now_s())))

    def _let_in(self, connection: ServerConnection, request: Any) -> Any:
        if self.refuse_with is None:
            return None
        return connection.respond(HTTPStatus(self.refuse_with), "not now\n")

    async def _run(self, ready: threading.Event, over: asyncio.Event) -> None:
        async with serve(
            self._serve, "127.0.0.1", 0, process_request=self._let_in, compression=None
        ) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            ready.set()
            await over.wait()

    @contextmanager
    def serving(self) -> Iterator[FakeService]:
        with self._own.running(self._run):
            yield self
