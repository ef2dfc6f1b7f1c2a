"""The 3D scene of a mission, behind the service's own access control.

viser itself has none (see `app.viewer.server`), so its page is served from here and its WebSocket is
relayed: to the browser everything, to viser only what its reader's role allows.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Coroutine
from pathlib import Path
from typing import Any, Final

import anyio
import msgspec
import viser
from fastapi import APIRouter, Request, WebSocket
from fastapi.responses import FileResponse, RedirectResponse, Response
from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from app.deps import MetricsDep, MissionDep, PrincipalDep, RulesDep, ScenesDep, ServiceDep, StreamsDep
from app.errors import NotFound, Unavailable
from app.security.principal import Role
from app.viewer.server import proof_headers

log = logging.getLogger(__name__)

router = APIRouter(prefix="/viewer", include_in_schema=False)

PAGE: Final = Path(viser.__file__).parent / "client" / "build" / "index.html"
"""viser's whole client, one file."""
_LOOKING: Final = frozenset({"ViewerCameraMessage", "GetRenderResponseMessage"})
ALLOWED: Final = {
    Role.VIEWER: _LOOKING,
    Role.OPERATOR: _LOOKING | {"GuiUpdateMessage"},  # layers and height: the scene's, for all who look
}
"""Kinds of messages that may reach viser."""
_CHECK_S: Final = 2.0


@router.get("/{mission_id}", operation_id="redirectToScene")
def redirect_to_scene(mission: MissionDep) -> Response:
    return RedirectResponse(f"/viewer/{mission.id}/", status_code=308)


@router.get("/{mission_id}/", operation_id="getScene")
def get_scene(mission: MissionDep, scenes: ScenesDep, request: Request) -> Response:
    """viser's page. It takes no orders from its address: `?websocket=` would connect it elsewhere."""
    if scenes is None:
        raise NotFound("this service serves no 3D scenes")
    if request.url.query:
        return RedirectResponse(request.url.path, status_code=303)
    return FileResponse(PAGE, media_type="text/html", headers={"Cache-Control": "no-cache"})


@router.websocket("/{mission_id}")
async def relay_scene(
    websocket: WebSocket,
    mission_id: str,
    service: ServiceDep,
    scenes: ScenesDep,
    streams: StreamsDep,
    metrics: MetricsDep,
    rules: RulesDep,
    principal: PrincipalDep,
) -> None:
    """Relay between a browser and the viser server of a mission."""
    try:
        if scenes is None:
            raise NotFound("this service serves no 3D scenes")
        mission = await run_in_threadpool(service.get, mission_id)
        looking = scenes.looking_at(mission)
        scene = await run_in_threadpool(looking.__enter__)
    except (NotFound, Unavailable) as refusal:
        await websocket.close(code=4404, reason=refusal.detail[:120])
        return
    try:
        wanted = [Subprotocol(name) for name in websocket.scope["subprotocols"]]
        async with connect(
            scene.url.replace("http", "ws", 1),
            subprotocols=wanted or None,
            additional_headers=proof_headers(),
            compression=None,
            max_size=None,
            max_queue=4,
            proxy=None,
        ) as inner:
            await websocket.accept(subprotocol=inner.subprotocol)
            with metrics.subscriber("viewer"):
                async with anyio.create_task_group() as group:

                    async def first_to_end(relay: Coroutine[Any, Any, None]) -> None:
                        with contextlib.suppress(ConnectionClosed, WebSocketDisconnect):
                            await relay
                        group.cancel_scope.cancel()

                    async def until_it_may_no_longer() -> None:
                        while rules.holds(principal) and not streams.ended:
                            await streams.pause(_CHECK_S)

                    for part in (
                        _to_browser(inner, websocket),
                        _to_viser(websocket, inner, ALLOWED[principal.role], principal.name),
                        until_it_may_no_longer(),
                    ):
                        group.start_soon(first_to_end, part)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await websocket.close(code=1001)
    except (OSError, ConnectionClosed) as error:
        log.warning("the viewer of mission %s cannot be reached: %s", mission_id, error)
    finally:
        await run_in_threadpool(looking.__exit__, None, None, None)


async def _to_browser(inner: ClientConnection, websocket: WebSocket) -> None:
    """One message at a time: a browser that is slow makes viser wait, which replaces what is outdated."""
    async for message in inner:
        assert isinstance(message, bytes)
        await websocket.send_bytes(message)


async def _to_viser(
    websocket: WebSocket, inner: ClientConnection, allowed: frozenset[str], name: str
) -> None:
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
        kind, content = read_message(message.get("bytes"))
        if kind in allowed:
            await inner.send(content)
        else:
            log.warning("dropped a message of kind %r that %s sent to the viewer", kind, name)


def read_message(content: bytes | None) -> tuple[str | None, bytes]:
    """The kind of a message to viser (None for what is none), and the message written anew.

    Anew, because a map may name its kind twice: what was checked is what viser reads.
    """
    try:
        message = msgspec.msgpack.decode(content, type=dict[str, Any]) if content else {}
        return str(message.get("type"))[:64], msgspec.msgpack.encode(message)
    except (msgspec.MsgspecError, ValueError, TypeError, RecursionError):
        return None, b""
