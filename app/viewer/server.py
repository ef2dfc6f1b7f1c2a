"""A viser server that only this service reaches and that opens no tunnel.

viser listens on every interface by default, checks neither password nor origin, and lets any client ask it
to publish the scene through a public tunnel (`ShareUrlRequest`). Here it listens on 127.0.0.1 at a free
port, and answers only requests with a secret that this process alone knows: another user of this machine,
or a website open in its browser, reaches the port but gets no further. The tunnel handlers are gone, and
the messages that would reach them are dropped before any handler sees them.
"""

from __future__ import annotations

import contextlib
import hmac
import http
import io
import logging
import secrets
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final, NoReturn

import viser
import websockets.asyncio.server
from viser import _messages
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from app.errors import Forbidden

log = logging.getLogger(__name__)

LOOPBACK: Final = "127.0.0.1"
DROPPED: Final = (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect)

_PROOF_HEADER: Final = "X-HGS-Proof"
_PROOF: Final = secrets.token_urlsafe(32)
_OPENING: Final = threading.Lock()


def proof_headers() -> dict[str, str]:
    """What a request to a viser server of this process must carry."""
    return {_PROOF_HEADER: _PROOF}


def open_viser_server(label: str) -> viser.ViserServer:
    """A running server on loopback, at a port that was free."""
    with (
        _asking_for_proof(),
        contextlib.redirect_stdout(io.StringIO()),
    ):  # its banner would look like the service's own address
        server = viser.ViserServer(host=LOOPBACK, port=0, label=label, verbose=False)
    _forbid_sharing(server)
    server.gui.configure_theme(
        show_logo=False, show_share_button=False, dark_mode=True, control_width="small"
    )
    return server


@contextlib.contextmanager
def _asking_for_proof() -> Iterator[None]:
    """viser has no place for a check of requests, so that of its WebSocket library is wrapped meanwhile."""
    with _OPENING:
        serve = websockets.asyncio.server.serve

        def guarded_serve(*arguments: Any, process_request: Callable[..., Any], **options: Any) -> Any:
            def answer(connection: ServerConnection, request: Request) -> Response | None:
                shown = request.headers.get_all(_PROOF_HEADER)
                if len(shown) != 1 or not hmac.compare_digest(shown[0].encode(), _PROOF.encode()):
                    return connection.respond(http.HTTPStatus.FORBIDDEN, "Go through the service.\n")
                found: Response | None = process_request(connection, request)
                return found

            return serve(*arguments, process_request=answer, **options)

        websockets.asyncio.server.serve = guarded_serve  # type: ignore[misc, assignment]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = serve  # type: ignore[misc]


def _forbid_sharing(server: viser.ViserServer) -> None:
    sockets = server._websock_server
    for message in DROPPED:
        sockets.unregister_handler(message)
    handle = sockets._handle_incoming_message

    async def handle_unless_dropped(client_id: Any, message: Any) -> None:
        if isinstance(message, DROPPED):
            log.warning("viewer client %s asked for a public tunnel; refused", client_id)
            return
        await handle(client_id, message)

    def refuse(*_: Any, **__: Any) -> NoReturn:
        raise Forbidden("the viewer is never published through a tunnel")

    sockets._handle_incoming_message = handle_unless_dropped  # type: ignore[method-assign]
    server.request_share_url = refuse  # type: ignore[method-assign]
