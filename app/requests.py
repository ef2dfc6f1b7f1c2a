"""What the service writes down of every request: a number, a line in the log, a measurement.

The outermost part of the application, around the gate: what is refused is seen as well.
"""

from __future__ import annotations

import logging
import re
import secrets
import time
from typing import Final

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from structlog.contextvars import bound_contextvars

from app.metrics import Metrics
from app.security.access import SAFE_METHODS
from app.security.principal import UNKNOWN, principal_of

log = logging.getLogger(__name__)

REQUEST_ID: Final = "x-request-id"
_GIVEN_ID: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
API_PREFIX: Final = "/api/v1"
_MISSION: Final = re.compile(r"/(?:api/v1/missions|viewer)/([A-Za-z0-9-]{1,64})(?:/.*)?")
_UNPRINTABLE: Final = re.compile(r"[^\x20-\x7e]")
_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS", "POST", "PUT", "PATCH", "DELETE"})


class Requests:
    """ASGI middleware. Gives each request an id, which the answer carries as `X-Request-ID`: the client's
    own, where it sent one.
    """

    def __init__(self, app: ASGIApp, *, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        request_id = _request_id(scope)
        facts = {"request": request_id}
        if (found := _MISSION.fullmatch(scope["path"])) is not None:
            facts["mission"] = found[1]
        with bound_contextvars(**facts):
            if scope["type"] == "websocket":
                await self._app(scope, receive, send)
                return
            answer = _Watched(send, request_id)
            try:
                await self._app(scope, receive, answer)
            finally:
                self._note(scope, answer)

    def _note(self, scope: Scope, answer: _Watched) -> None:
        method = scope["method"] if scope["method"] in _METHODS else "other"
        route = route_of(scope)
        if answer.status is not None:
            self._metrics.request(method, route, answer.status, answer.waited_s)
        principal = principal_of(scope)
        failed = answer.status is None or answer.status >= 500
        level = logging.ERROR if failed else logging.INFO if method not in SAFE_METHODS else logging.DEBUG
        if not log.isEnabledFor(level):
            return
        log.log(
            level,
            "%s %s: %s",
            method,
            _UNPRINTABLE.sub("?", scope["path"])[:300],  # never the query, nor any header
            answer.status or "no answer",
            extra={
                "route": route,
                "status": answer.status,
                "milliseconds": round(1000 * answer.waited_s, 1),
                "actor": principal.name if principal is not None else UNKNOWN,
            },
        )


def route_of(scope: Scope) -> str:
    """The route's template: as many values as there are routes, whatever is asked for."""
    route = scope.get("route")
    if route is not None:
        template = str(route.path)
        # A route knows the prefix of its own router, not that of the one which includes it.
        inside = scope["path"].startswith(API_PREFIX) and not template.startswith(API_PREFIX)
        return API_PREFIX + template if inside else template
    return "page" if "endpoint" in scope else "none"


def _request_id(scope: Scope) -> str:
    given = Headers(scope=scope).get(REQUEST_ID, "")
    return given if _GIVEN_ID.fullmatch(given) else secrets.token_hex(8)


class _Watched:
    """`send` that adds the request's id, and remembers the status and how long it took to begin."""

    def __init__(self, send: Send, request_id: str) -> None:
        self._send = send
        self._header = (REQUEST_ID.encode(), request_id.encode())
        self._began = time.perf_counter()
        self._waited_s: float | None = None
        self.status: int | None = None

    @property
    def waited_s(self) -> float:
        """Until the answer began [s]: a stream's end says nothing about how quick the service is."""
        return self._waited_s if self._waited_s is not None else time.perf_counter() - self._began

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self._waited_s = time.perf_counter() - self._began
            self.status = message["status"]
            message = {**message, "headers": [*message.get("headers", []), self._header]}
        await self._send(message)
