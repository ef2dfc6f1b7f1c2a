"""uvicorn, so that no client can hold it up: heads must come in time, and what is sent must be taken in.

uvicorn has limits for idle connections, but none for a head that comes a byte at a time (slowloris), nor
for a reader that stops reading. Both are ended here, below the application.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from app.settings import LimitSettings, Settings

SHUTDOWN_S = 4
"""How long open connections may finish when the service stops [s]."""


class Server(uvicorn.Server):
    """Ends event streams as soon as it stops; uvicorn would wait for their readers to leave."""

    def __init__(self, config: uvicorn.Config, *, end_streams: Callable[[], None]) -> None:
        super().__init__(config)
        self._end_streams = end_streams

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._end_streams()
        await super().shutdown(sockets)


def server_of(app: ASGIApp, settings: Settings, *, end_streams: Callable[[], None]) -> Server:
    """A server for `app`, as `settings` say; `run` it."""
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        workers=1,
        log_level="warning",
        http=_guarded_http(settings.limits),
        ws=_guarded_websocket(settings.limits),
        ws_max_size=settings.limits.message_bytes,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=SHUTDOWN_S,
        server_header=False,
        proxy_headers=bool(settings.access.trusted_proxies),
        forwarded_allow_ips=list(settings.access.trusted_proxies),
    )
    return Server(config, end_streams=end_streams)


class _StallWatch:
    """Aborts a connection whose peer takes in nothing for `limit_s` while something waits to be sent."""

    def __init__(self, transport: asyncio.Transport, limit_s: float) -> None:
        self._transport = transport
        self._limit_s = limit_s
        self._timer: asyncio.TimerHandle | None = None
        self._waiting_bytes = 0

    def begin(self) -> None:
        self._waiting_bytes = self._transport.get_write_buffer_size()
        self._timer = asyncio.get_running_loop().call_later(self._limit_s, self._check)

    def end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _check(self) -> None:
        if self._transport.get_write_buffer_size() < self._waiting_bytes:
            self.begin()  # slow, but alive
        else:
            self._transport.abort()


def _guarded_http(limits: LimitSettings) -> type[HttpToolsProtocol]:
    """HTTP whose connections wait for a head only so long, and only so many of them."""
    waiting: dict[HttpToolsProtocol, asyncio.TimerHandle] = {}

    class GuardedHttp(HttpToolsProtocol):
        _stall: _StallWatch
        _head_bytes = 0

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._stall = _StallWatch(transport, limits.send_s)
            self._wait()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self in waiting:
                # The parser keeps what it has of a head, however much that is.
                self._head_bytes += len(data)
                if self._head_bytes > limits.head_bytes:
                    self.transport.abort()

        def connection_lost(self, exc: Exception | None) -> None:
            self._stop_waiting()
            self._stall.end()
            super().connection_lost(exc)

        def on_headers_complete(self) -> None:
            self._stop_waiting()
            super().on_headers_complete()

        def handle_websocket_upgrade(self) -> None:
            self._stop_waiting()
            self._stall.end()
            super().handle_websocket_upgrade()

        def on_response_complete(self) -> None:
            super().on_response_complete()
            if not self.transport.is_closing() and self not in waiting:
                self._wait()

        def pause_writing(self) -> None:
            super().pause_writing()
            self._stall.begin()

        def resume_writing(self) -> None:
            self._stall.end()
            super().resume_writing()

        def _wait(self) -> None:
            # The newest is let in and the one that waits longest goes: an operator's STOP comes all at once.
            if len(waiting) >= limits.connections:
                next(iter(waiting)).transport.abort()
            self._stop_waiting()
            self._head_bytes = 0
            waiting[self] = self.loop.call_later(limits.header_s, self.transport.abort)

        def _stop_waiting(self) -> None:
            timer = waiting.pop(self, None)
            if timer is not None:
                timer.cancel()

    return GuardedHttp


def _guarded_websocket(limits: LimitSettings) -> type[WebSocketsSansIOProtocol]:
    class GuardedWebSocket(WebSocketsSansIOProtocol):
        _stall: _StallWatch

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            self._stall = _StallWatch(transport, limits.send_s)

        def connection_lost(self, exc: Exception | None) -> None:
            self._stall.end()
            super().connection_lost(exc)

        def pause_writing(self) -> None:
            super().pause_writing()
            self._stall.begin()

        def resume_writing(self) -> None:
            self._stall.end()
            super().resume_writing()

    return GuardedWebSocket
