"""Events of a mission: history over REST, live over a WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import json
from typing import Annotated

import anyio
from fastapi import APIRouter, Query, WebSocket, WebSocketDisconnect

from app.deps import MissionDep, ServiceDep
from app.errors import NotFound
from app.missions.mission import Mission
from app.schemas import EventPage

router = APIRouter(prefix="/missions", tags=["events"])

_QUIET_S = 5.0
"""A quiet stream says `alive` so often, so that a page can tell silence from a lost connection."""


@router.get("/{mission_id}/events", operation_id="listEvents")
def list_events(
    mission: MissionDep,
    after: Annotated[int, Query(ge=0, description="Only events with a higher sequence number")] = 0,
    limit: Annotated[int, Query(ge=1, le=5_000)] = 500,
    kind: Annotated[list[str] | None, Query(description="Only these kinds; repeat for several")] = None,
    newest: Annotated[bool, Query(description="The last ones, not the first; `after` is ignored")] = False,
) -> EventPage:
    """Past events in order."""
    if newest:
        events, more = mission.log.newest_of(kind, limit)
        return EventPage(events=events, more=more)
    events, more = mission.log.history(after=after, limit=limit, kinds=kind)
    return EventPage(events=events, more=more)


@router.websocket("/{mission_id}/events")
async def stream_events(websocket: WebSocket, mission_id: str, service: ServiceDep, after: int = 0) -> None:
    """Events as they come, from `after` on, one JSON object a message.

    A reader that cannot keep up misses telemetry, never a change of state. `{"kind": "alive"}` keeps a quiet
    stream going; it has no sequence number.
    """
    await websocket.accept()
    try:
        mission = service.get(mission_id)
    except NotFound as error:
        await websocket.close(code=4404, reason=error.detail)
        return
    if after < 0:
        await websocket.close(code=4422, reason=f"after is {after}, expected a sequence number")
        return
    async with anyio.create_task_group() as group:

        async def listen() -> None:
            await _until_disconnect(websocket)
            group.cancel_scope.cancel()

        group.start_soon(listen)
        with contextlib.suppress(WebSocketDisconnect):
            await _send(websocket, mission, after)
        group.cancel_scope.cancel()


async def _send(websocket: WebSocket, mission: Mission, cursor: int) -> None:
    loop = asyncio.get_running_loop()
    changed = asyncio.Event()

    def wake() -> None:
        with contextlib.suppress(RuntimeError):  # the loop has closed: nobody is left to wake
            loop.call_soon_threadsafe(changed.set)

    mission.log.add_waker(wake)
    try:
        while True:
            changed.clear()
            events = mission.log.live(cursor)
            for event in events:
                await websocket.send_text(json.dumps(event, allow_nan=False))
                cursor = event["sequence"]
            if events:
                continue
            with anyio.move_on_after(_QUIET_S) as quiet:
                await changed.wait()
            if quiet.cancelled_caught:
                alive = {"kind": "alive", "state": str(mission.state), "silent_s": mission.silent_s}
                await websocket.send_text(json.dumps(alive))
    finally:
        mission.log.remove_waker(wake)


async def _until_disconnect(websocket: WebSocket) -> None:
    """Clients have nothing to say; what they send is read and dropped."""
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
