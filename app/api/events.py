"""Events of a mission: history over REST, live over a WebSocket or as server-sent events."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncGenerator, AsyncIterator
from typing import Annotated, Any

import anyio
from fastapi import APIRouter, Header, Query, WebSocket, WebSocketDisconnect, status
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from app.deps import (
    MetricsDep,
    MissionDep,
    PrincipalDep,
    RulesDep,
    ServiceDep,
    StreamPlaceDep,
    StreamsDep,
)
from app.errors import NotFound
from app.event_texts import EventTexts
from app.metrics import Metrics
from app.openapi import problems
from app.schemas import EventPage

router = APIRouter(prefix="/missions", tags=["events"])

_EventKind = Annotated[str, Query(max_length=50, pattern=r"^[a-z_]+$")]


@router.get("/{mission_id}/events", operation_id="listEvents", responses=problems(404))
def list_events(
    mission: MissionDep,
    after: Annotated[int, Query(ge=0, le=2**31 - 1, description="Only events with a higher number")] = 0,
    before: Annotated[
        int | None, Query(ge=1, le=2**31 - 1, description="Only events with a lower number")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=5_000)] = 500,
    kind: Annotated[
        list[_EventKind] | None, Query(description="Only these kinds; repeat for several", max_length=20)
    ] = None,
    newest: Annotated[bool, Query(description="The last ones, not the first")] = False,
) -> EventPage:
    """Past events in order."""
    events, more = mission.log.history(after=after, before=before, limit=limit, kinds=kind, newest=newest)
    return EventPage(events=events, more=more)


@router.get(
    "/{mission_id}/events/stream",
    operation_id="streamEvents",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "Events as they come; `id` is the sequence number, `data` the event",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        },
        **problems(404),
    },
)
async def stream_server_sent_events(
    mission: MissionDep,
    _place: StreamPlaceDep,
    streams: StreamsDep,
    metrics: MetricsDep,
    rules: RulesDep,
    principal: PrincipalDep,
    after: Annotated[int, Query(ge=0, le=2**31 - 1, description="Only events with a higher number")] = 0,
    last_event_id: Annotated[
        int | None, Header(ge=0, le=2**31 - 1, description="The same; browsers send it when they reconnect")
    ] = None,
) -> StreamingResponse:
    """Live events as server-sent events, from `after` or Last-Event-ID on.

    A reader that cannot keep up misses telemetry, never a change of state. `event: alive`, without an id,
    keeps a quiet stream going.
    """
    cursor = max(after, last_event_id or 0)
    events = streams.follow(mission, cursor, allowed=lambda: rules.holds(principal))
    # Not FastAPI's own EventSourceResponse: its queues raise when a reader leaves.
    return StreamingResponse(
        _encoded(events, metrics, mission.id, streams.texts),
        media_type="text/event-stream",
        headers={"X-Accel-Buffering": "no"},
    )


async def _encoded(
    events: AsyncGenerator[dict[str, Any]], metrics: Metrics, mission_id: str, texts: EventTexts
) -> AsyncIterator[bytes]:
    async with contextlib.aclosing(events):
        with metrics.subscriber("sse"):
            async for event in events:
                yield texts.of(mission_id, event).server_sent


@router.websocket("/{mission_id}/events")
async def stream_events(
    websocket: WebSocket,
    mission_id: str,
    service: ServiceDep,
    streams: StreamsDep,
    metrics: MetricsDep,
    rules: RulesDep,
    principal: PrincipalDep,
) -> None:
    """Events as they come, from `after` on, one JSON object a message; see `stream_server_sent_events`.

    Close codes: 4401 the login ended, 4404 no such mission, 4422 `after` is not a sequence number, 1012 the
    service restarts.
    """
    await websocket.accept()
    wish = websocket.query_params.get("after", "0")
    if not (wish.isascii() and wish.isdigit() and len(wish) < 10):
        await websocket.close(code=4422, reason="after: expected a sequence number")
        return
    try:
        mission = await run_in_threadpool(service.get, mission_id)
    except NotFound:
        await websocket.close(code=4404, reason="there is no such mission")
        return
    async with anyio.create_task_group() as group:

        async def listen() -> None:
            await _until_disconnect(websocket)
            group.cancel_scope.cancel()

        group.start_soon(listen)
        with contextlib.suppress(WebSocketDisconnect), metrics.subscriber("websocket"):
            events = streams.follow(mission, int(wish), allowed=lambda: rules.holds(principal))
            async with contextlib.aclosing(events):
                async for event in events:
                    await websocket.send_text(streams.texts.of(mission.id, event).text)
            code = status.WS_1012_SERVICE_RESTART if streams.ended else 4401
            await websocket.close(code=code, reason="the service ends" if streams.ended else "log in again")
        group.cancel_scope.cancel()


async def _until_disconnect(websocket: WebSocket) -> None:
    """Clients have nothing to say; what they send is read and dropped."""
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
