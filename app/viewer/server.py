"""A viser server that only this machine reaches and that opens no tunnel.

viser listens on every interface by default, checks neither password nor origin, and lets any client ask it
to publish the scene through a public tunnel (`ShareUrlRequest`). Here it listens on 127.0.0.1 at a free port,
the tunnel handlers are gone, and the messages that would reach them are dropped before any handler sees them.
"""

from __future__ import annotations

import contextlib
import io
import logging
from typing import Any, Final, NoReturn

import viser
from viser import _messages

from app.errors import Forbidden

log = logging.getLogger(__name__)

LOOPBACK: Final = "127.0.0.1"
DROPPED: Final = (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect)


def open_viser_server(label: str) -> viser.ViserServer:
    """A running server on loopback, at a port that was free."""
    with contextlib.redirect_stdout(io.StringIO()):  # its banner would look like the service's own address
        server = viser.ViserServer(host=LOOPBACK, port=0, label=label, verbose=False)
    _forbid_sharing(server)
    server.gui.configure_theme(
        show_logo=False, show_share_button=False, dark_mode=True, control_width="small"
    )
    return server


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
