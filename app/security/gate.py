"""The gate that every request passes: who, from where, how often; and what the answer is told to browsers.

It is the outermost part of the application, so that nothing answers without it.
"""

from __future__ import annotations

import asyncio
import logging
import re
import time
from contextlib import ExitStack
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import HeadTooLarge, ServiceError, TooMany, problem, problem_of
from app.security.access import SAFE_METHODS, SESSION_PATH, AccessRules, HostList, WrongCredentials
from app.security.headers import RawHeaders, security_headers
from app.security.principal import UNKNOWN, Principal, Proof, principal_of, set_principal
from app.security.rates import Rates
from app.settings import LimitSettings
from app.storage.audit import AuditStore
from app.storage.database import StorageError
from app.storage.tables import AuditRecord

log = logging.getLogger(__name__)

_STOP: Final = re.compile(r"/api/v1/missions/[^/]+/stop")
_PRINTABLE: Final = re.compile(r"[^\x20-\x7e]")


class Gate:
    """ASGI middleware."""

    def __init__(
        self,
        app: ASGIApp,
        *,
        hosts: HostList,
        rules: AccessRules,
        rates: Rates,
        audit: AuditStore,
        limits: LimitSettings,
    ) -> None:
        self._app = app
        self._hosts = hosts
        self._rules = rules
        self._rates = rates
        self._audit = audit
        self._limits = limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        is_http = scope["type"] == "http"
        answer = _Answer(send, self._headers(scope) if is_http else [])
        try:
            with ExitStack() as stream:
                self._admit(scope)
                if not is_http:
                    stream.enter_context(self._rates.stream(_client(scope)))
                await self._app(scope, self._in_time(receive) if is_http else receive, answer)
        except ServiceError as refusal:
            await self._refuse(scope, receive, answer, problem_of(Request(_as_http(scope)), refusal))
        except Exception as error:
            log.exception("unexpected error in %s", scope["path"], exc_info=error)
            if answer.status is not None:
                raise
            await self._refuse(scope, receive, answer, _unexpected(scope, error))
        if is_http and _is_change(scope):
            await self._write_down(scope, answer.status or 0)

    def _admit(self, scope: Scope) -> None:
        """Find out who asks, and raise a `ServiceError` unless they may."""
        headers, address = Headers(scope=scope), _address(scope)
        set_principal(scope, None)
        if sum(len(name) + len(value) for name, value in headers.raw) > self._limits.head_bytes:
            raise HeadTooLarge(f"the header fields have more than {self._limits.head_bytes} bytes")
        hosts = headers.getlist("host")
        self._hosts.check(hosts[0] if len(hosts) == 1 else "")
        principal = self._identify(scope, headers, address)
        set_principal(scope, principal)
        is_stop = scope["type"] == "http" and _STOP.fullmatch(scope["path"]) is not None
        if not (is_stop and principal is not None):
            self._rates.count_request(_client(scope))
            if scope["type"] == "http" and _is_change(scope):
                self._rates.count_change(_client(scope))
        self._rules.check_origin(scope, headers, principal)
        self._rules.check_role(scope, principal)

    def _identify(self, scope: Scope, headers: Headers, address: str) -> Principal | None:
        try:
            return self._rules.identify(headers)
        except WrongCredentials:
            if "authorization" in headers:
                # A right token is let in however many wrong ones came from the same address: somebody else's
                # guesses must not keep an operator from STOP. At 256 bits, guessing is no way in.
                self._rates.count_login(address)
                raise
            if scope["path"] == SESSION_PATH or not scope["path"].startswith(("/api/", "/viewer/")):
                return None  # an expired session may log in again
            raise

    def _headers(self, scope: Scope) -> RawHeaders:
        host = Headers(scope=scope).get("host", "")
        try:
            self._hosts.check(host)
        except ServiceError:
            host = "localhost"  # a refusal repeats no name that it does not trust
        return security_headers(scope["path"], host)

    def _in_time(self, receive: Receive) -> Receive:
        """`receive`, but a body must have come whole before its time is up, and be no larger than allowed."""
        deadline = asyncio.get_running_loop().time() + self._limits.body_s
        complete, size = False, 0

        async def receive_in_time() -> Message:
            nonlocal complete, size
            if complete:
                return await receive()
            try:
                async with asyncio.timeout_at(deadline):
                    message = await receive()
            except TimeoutError:
                raise HTTPException(408, "Request Timeout") from None
            complete = message["type"] != "http.request" or not message.get("more_body", False)
            size += len(message.get("body", b""))
            if size > self._limits.body_bytes:
                raise HTTPException(413, "Content Too Large")
            return message

        return receive_in_time

    async def _refuse(self, scope: Scope, receive: Receive, send: Send, response: Response) -> None:
        if scope["type"] == "http":
            await response(scope, receive, send)
        elif "websocket.http.response" in scope.get("extensions", {}):
            await send(
                {
                    "type": "websocket.http.response.start",
                    "status": response.status_code,
                    "headers": response.raw_headers,
                }
            )
            await send({"type": "websocket.http.response.body", "body": bytes(response.body)})
        else:
            await send({"type": "websocket.close", "code": 1008})

    async def _write_down(self, scope: Scope, status: int) -> None:
        """Every attempt to change something; but of a flood that was cut off, nothing."""
        if status == TooMany.status:
            return
        principal = principal_of(scope)
        record = AuditRecord(
            at=time.time(),
            actor=principal.name if principal is not None else UNKNOWN,
            role=str(principal.role) if principal is not None else "none",
            address=_address(scope)[:64],
            method=scope["method"][:16],
            path=_PRINTABLE.sub("?", scope["path"])[:300],
            status=status,
        )
        try:
            await run_in_threadpool(self._audit.add, record)
        except StorageError as error:
            log.error("not in the audit: %s: %s", record.model_dump_json(), error)


class _Answer:
    """`send` that adds the security headers and remembers the status."""

    def __init__(self, send: Send, headers: RawHeaders) -> None:
        self._send = send
        self._headers = headers
        self.status: int | None = None

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            own = {name.lower() for name, _ in message.get("headers", [])}
            added = [(name, value) for name, value in self._headers if name not in own]
            message = {**message, "headers": [*message.get("headers", []), *added]}
        elif message["type"] in ("websocket.accept", "websocket.close", "websocket.http.response.start"):
            self.status = message.get("status", 101)
        await self._send(message)


def _is_change(scope: Scope) -> bool:
    return scope["method"] not in SAFE_METHODS and scope["path"].startswith(("/api/", "/viewer/"))


def _client(scope: Scope) -> str:
    """Whose share of the limits this is: a token's or a session's, or else an address's."""
    principal = principal_of(scope)
    if principal is None or principal.proof is Proof.NONE_NEEDED:
        return f"address {_address(scope)}"
    return principal.client


def _address(scope: Scope) -> str:
    client = scope.get("client")
    return str(client[0]) if client else "unknown"


def _as_http(scope: Scope) -> Scope:
    return scope if scope["type"] == "http" else {**scope, "type": "http", "method": "GET"}


def _unexpected(scope: Scope, error: Exception) -> Response:
    return problem(
        Request(_as_http(scope)),
        status=500,
        title=ServiceError.title,
        detail=f"{type(error).__name__}: see the service's log",
    )
