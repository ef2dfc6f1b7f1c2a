"""`Connection`: one WebSocket, from the robot's hello to its end."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Final

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from app.robot.delay_line import DelayLine
from hgs_core.errors import StreamError
from hgs_core.live.messages import FromRobot, Report, ToRobot, encoded, to_robot

REPORT_EVERY_S: Final = 0.1
OPEN_S: Final = 5.0
_LOOK_S: Final = 0.1
_MOST_WAITING: Final = 1000
_LARGEST_MESSAGE: Final = 16 * 2**20


class Connection:
    """Sends and hears, each at its own pace; messages take `latency_s` either way.

    `hear` is called with every message that is understood, `misheard` with what is wrong with any other;
    `report` is asked ten times a second, and may give None; so is `complaint`: why to end it.
    """

    def __init__(
        self,
        socket: ClientConnection,
        *,
        latency_s: float,
        silence_s: float,
        hear: Callable[[ToRobot], None],
        misheard: Callable[[str], None],
        report: Callable[[], Report | None],
        complaint: Callable[[], str | None],
    ) -> None:
        self.silence_s = silence_s
        """Over when nothing is heard for so long."""
        self.close_code: int | None = None
        """With which it was closed, once it is."""
        self._socket = socket
        self._outbox: DelayLine[FromRobot] = DelayLine(latency_s, most=_MOST_WAITING)
        self._inbox: DelayLine[bytes | str] = DelayLine(latency_s, most=_MOST_WAITING)
        self._hear = hear
        self._misheard = misheard
        self._report = report
        self._complaint = complaint
        self._heard_s = time.monotonic()

    @staticmethod
    async def open(url: str, headers: dict[str, str]) -> ClientConnection:
        """Raises what `websockets.connect` does."""
        return await connect(
            url,
            additional_headers=headers,
            compression=None,  # images are compressed already
            max_size=_LARGEST_MESSAGE,
            open_timeout=OPEN_S,
            close_timeout=1.0,
        )

    def send(self, message: FromRobot) -> bool:
        """In a moment; lost, and False, when too much waits already."""
        return self._outbox.put(message)

    async def talk(self, over: asyncio.Event) -> str:
        """Until it ends, or until `over`; why it ended. The socket is closed afterwards."""
        parts = (self._receive(), self._handle(), self._transmit(), self._reports(), self._watch())
        tasks = [*map(asyncio.create_task, parts), asyncio.create_task(_wait_for(over))]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
            await self._socket.close()
        self.close_code = self._socket.close_code
        for result in results:
            if isinstance(result, Exception) and not isinstance(result, ConnectionClosed | OSError):
                raise result
        return "; ".join(str(task.exception() or task.result()) for task in done)

    async def _receive(self) -> str:
        async for content in self._socket:
            if not self._inbox.put(content):
                return "the service says more than can be heard"
        return "the service has closed it"

    async def _handle(self) -> str:
        while True:
            content = await self._inbox.get()
            try:
                if isinstance(content, str):
                    raise StreamError("a text where a message was expected")
                message = to_robot(content)
            except StreamError as error:
                self._misheard(str(error))
            else:
                self._heard_s = time.monotonic()
                self._hear(message)

    async def _transmit(self) -> str:
        while True:
            await self._socket.send(encoded(await self._outbox.get()))

    async def _reports(self) -> str:
        while True:
            await asyncio.sleep(REPORT_EVERY_S)
            report = self._report()
            if report is not None:
                self.send(report)

    async def _watch(self) -> str:
        while (silent_s := time.monotonic() - self._heard_s) < self.silence_s:
            if (complaint := self._complaint()) is not None:
                return complaint
            await asyncio.sleep(_LOOK_S)
        return f"nothing heard for {silent_s:.1f} s"


async def _wait_for(event: asyncio.Event) -> str:
    await event.wait()
    return ""
