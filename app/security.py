"""Keeping other websites out of a service on this machine.

A page from elsewhere, open in the operator's browser, can reach loopback addresses too. So requests must name
this machine as their host, and whatever changes something or listens must come from this service's own page
(or from a program, which sends no Origin).
"""

from __future__ import annotations

from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

from app.errors import Forbidden, problem

LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "::1", "[::1]"})
_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})


class LocalOnly:
    """ASGI middleware: refuses foreign hosts, foreign origins, and adds the page's security headers."""

    def __init__(self, app: ASGIApp, *, viewer_origin: str | None = None) -> None:
        self._app = app
        frames = f"'self' {viewer_origin}" if viewer_origin else "'self'"
        policy = (
            "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; script-src 'self'; "
            f"connect-src 'self' ws://127.0.0.1:* ws://localhost:*; frame-src {frames}; "
            "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
        )
        self._headers = [
            (b"content-security-policy", policy.encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is not None and scope["type"] == "websocket":
            await WebSocket(scope, receive, send).close(code=1008, reason=refusal)
            return
        if refusal is not None:
            request = Request(scope, receive)
            response = problem(request, status=Forbidden.status, title=Forbidden.title, detail=refusal)
            await response(scope, receive, send)
            return

        async def send_with_headers(message: dict) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *self._headers]
            await send(message)

        await self._app(scope, receive, send_with_headers if scope["type"] == "http" else send)  # type: ignore[arg-type]

    @staticmethod
    def _refusal(scope: Scope) -> str | None:
        """Why a request is refused, or None."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if _host_name(host) not in LOCAL_NAMES:
            return f"this service answers to localhost and 127.0.0.1 only, not to {host!r}"
        origin = headers.get("origin")
        listening_or_changing = scope["type"] == "websocket" or scope["method"] not in _SAFE_METHODS
        if origin is not None and listening_or_changing and urlsplit(origin).netloc != host:
            return f"requests from the page {origin!r} are not accepted"
        return None


def _host_name(host: str) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None
