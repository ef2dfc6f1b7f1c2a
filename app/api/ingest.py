"""The way in for robots: frames and reports come, paths and STOP go back, over one WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Final

import anyio
from fastapi import APIRouter, WebSocket, WebSocketDisconnect, status
from starlette.concurrency import run_in_threadpool

from app.api.robot_view import robot_detail
from app.deps import MissionDep, PrincipalDep, RulesDep, ServiceDep, StreamsDep
from app.errors import NotFound
from app.missions.robot_link import CLOSED, NO_MORE, RobotLink
from app.openapi import problems
from app.schemas import RobotDetail
from app.security.access import AccessRules
from app.security.principal import Principal
from app.streams import Streams

router = APIRouter(tags=["robots"])

_MOST_WAITING: Final = 200
_CHECK_S: Final = 1.0
_LAST_WORDS_S: Final = 2.0


class _Connection:
    """One robot's WebSocket, as its link tells it things from other threads."""

    def __init__(self, websocket: WebSocket, link: RobotLink) -> None:
        self._websocket = websocket
        self._link = link
        self._loop = asyncio.get_running_loop()
        self._waiting: asyncio.Queue[bytes] = asyncio.Queue(_MOST_WAITING)
        self.dismissed: tuple[int, str] | None = None
        self.over = asyncio.Event()
        self._news = asyncio.Event()
        """Something waits, or it is over."""

    def deliver(self, content: bytes, *, urgent: bool = False) -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed: the service has ended, and all of it
            self._loop.call_soon_threadsafe(self._put, content, urgent)

    def dismiss(self, code: int, reason: str) -> None:
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._dismiss, code, reason)

    def _put(self, content: bytes, urgent: bool) -> None:
        while urgent and not self._waiting.empty():
            self._waiting.get_nowait()
        try:
            self._waiting.put_nowait(content)
            self._news.set()
        except asyncio.QueueFull:
            self._dismiss(status.WS_1008_POLICY_VIOLATION, "the robot does not read what it is sent")

    def _dismiss(self, code: int, reason: str) -> None:
        self._link.disconnect(self)  # from here on it is not the mission's robot
        self.dismissed = self.dismissed or (code, reason[:120])
        self.over.set()
        self._news.set()

    async def send(self, *, last_words_s: float) -> None:
        """Pass on what waits, until it is over; a robot that does not read has so long for the rest."""
        while not self.over.is_set():
            await self._news.wait()
            self._news.clear()
            await self._send_waiting()
        with anyio.move_on_after(last_words_s):
            await self._send_waiting()

    async def _send_waiting(self) -> None:
        while not self._waiting.empty():
            await self._websocket.send_bytes(self._waiting.get_nowait())

    async def receive(self) -> None:
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(message.get("code", 1000))
            # What is text breaks the protocol like any other message that is not understood.
            content = message.get("bytes") or (message.get("text") or "").encode()
            self._link.take(self, content)

    async def watch(self, streams: Streams, rules: AccessRules, principal: Principal) -> None:
        """Dismiss the robot when the service ends or its login does."""
        while True:
            await asyncio.sleep(_CHECK_S)
            if streams.ended:
                self._link.halt("the service ends")
                self.dismiss(status.WS_1012_SERVICE_RESTART, "the service ends")
            elif not rules.holds(principal):
                self._link.halt("the robot's login has ended")
                self.dismiss(4401, "log in again")


@router.get("/missions/{mission_id}/robot", operation_id="getRobot", responses=problems(404))
async def get_robot(mission: MissionDep) -> RobotDetail:
    """Where a live mission's robot is, what it was told last, and how the link to it does."""
    link = mission.link
    if link is None:
        why = "it has no process" if mission.live else "its robot is simulated"
        raise NotFound(f"mission {mission.id} has no live robot now: {why}")
    return robot_detail(link)


@router.websocket("/ingest/{mission_id}")
async def ingest(
    websocket: WebSocket,
    mission_id: str,
    service: ServiceDep,
    streams: StreamsDep,
    rules: RulesDep,
    principal: PrincipalDep,
) -> None:
    """A robot's connection, from its hello to its end; `hgs_core.live.messages` has what is said.

    Close codes: 4401 the login ended, 4404 no such mission, 4409 another connection took this one's place,
    4410 the mission has no process now, 4411 it has ended or is not a live one, 1008 the robot does not read,
    1012 the service restarts.
    """
    await websocket.accept()
    try:
        mission = await run_in_threadpool(service.get, mission_id)
    except NotFound:
        await websocket.close(code=4404, reason="there is no such mission")
        return
    link = mission.link
    connection = None if link is None else _Connection(websocket, link)
    if link is None or connection is None or not link.connect(connection):
        final = mission.state.ended or not mission.live
        why = f"it is {mission.state}" if mission.live else "it is not a live one"
        advice = "" if final else ": start or resume it"
        code = NO_MORE if final else CLOSED
        await websocket.close(code=code, reason=f"the mission takes no robot: {why}{advice}")
        return
    try:
        async with anyio.create_task_group() as group:

            async def until_it_leaves() -> None:
                with contextlib.suppress(WebSocketDisconnect):
                    await connection.receive()
                group.cancel_scope.cancel()

            group.start_soon(until_it_leaves)
            group.start_soon(connection.watch, streams, rules, principal)
            with contextlib.suppress(WebSocketDisconnect):
                await connection.send(last_words_s=_LAST_WORDS_S)
                code, reason = connection.dismissed or (1000, "")
                await websocket.close(code=code, reason=reason)
            group.cancel_scope.cancel()
    finally:
        link.disconnect(connection)
