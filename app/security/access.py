"""The rules: who is asking, from which page, and whether they may.

Everything needs a role unless it is listed as open here, so that a new route is closed until somebody opens
it.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.types import Scope

from app.errors import Forbidden, Unauthorized
from app.security.principal import ANYONE, Principal, Proof, Role
from app.security.sessions import SessionBook
from app.security.tokens import TokenBook
from app.settings import AccessSettings, is_loopback

COOKIE: Final = "hgs_session"
SAFE_METHODS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
SESSION_PATH: Final = "/api/v1/session"
INGEST_PATH: Final = "/api/v1/ingest/"

METRICS_PATH: Final = "/metrics"
_CLOSED: Final = ("/api/", "/viewer/", "/openapi.json", METRICS_PATH)
"""Everything else is the page's own code, which anybody may read, and the health of the service."""
_LOCAL_NAMES: Final = frozenset({"localhost", "127.0.0.1", "::1"})


class WrongCredentials(Unauthorized):
    """A token or a session was shown, and is not one (any more)."""


class HostList:
    """Names under which the service may be addressed: another site's name may point here (DNS rebinding)."""

    def __init__(self, listen: str, allowed: Iterable[str]) -> None:
        self._names = _LOCAL_NAMES | {name.lower() for name in allowed} | {listen.lower()}
        self._any_address = listen in ("0.0.0.0", "::")

    def check(self, host: str) -> None:
        """Raises `Forbidden`. An address as such cannot be rebound: any will do where all are listened on."""
        name = _host_name(host)
        if name is None or not (name in self._names or (self._any_address and _is_address(name))):
            raise Forbidden(
                f"this service does not answer to the name {host[:100]!r}; HGS_ALLOWED_HOSTS lists more"
            )


class AccessRules:
    def __init__(
        self, tokens: TokenBook, sessions: SessionBook, settings: AccessSettings | None = None
    ) -> None:
        self._tokens = tokens
        self._sessions = sessions
        self._settings = settings or AccessSettings()

    @property
    def login_required(self) -> bool:
        return not self._tokens.empty

    def identify(self, headers: Headers) -> Principal | None:
        """Who is asking; None when nothing was shown. Raises `WrongCredentials`."""
        if not self.login_required:
            return Principal(name=ANYONE, role=Role.OPERATOR, proof=Proof.NONE_NEEDED)
        authorization = headers.get("authorization")
        if authorization is not None:
            scheme, _, secret = authorization.partition(" ")
            token = self._tokens.identify(secret.strip()) if scheme.lower() == "bearer" else None
            if token is None:
                raise WrongCredentials("the token is not one of this service's")
            return Principal(name=token.name, role=token.role, proof=Proof.TOKEN)
        cookie = _cookie(headers)
        if cookie is None:
            return None
        session = self._sessions.find(cookie)
        if session is None:
            raise WrongCredentials("the session has expired: log in again")
        return Principal(
            name=session.token.name,
            role=session.token.role,
            proof=Proof.SESSION,
            session=session.digest,
            expires_at=session.expires_at,
        )

    def holds(self, principal: Principal) -> bool:
        """Whether somebody who was let in is so still."""
        return principal.session is None or self._sessions.with_digest(principal.session) is not None

    def check_origin(self, scope: Scope, headers: Headers, principal: Principal | None) -> None:
        """What changes something or listens must come from this service's own page, or from a program.

        Browsers send an Origin with these; programs send none, but they show a token, not a cookie.
        Raises `Forbidden`.
        """
        if scope["type"] == "http" and scope["method"] in SAFE_METHODS:
            return
        origin = headers.get("origin")
        if origin is None and (principal is None or principal.proof is not Proof.SESSION):
            return
        if origin is None or not _same_origin(origin, headers.get("host", ""), scope["scheme"]):
            raise Forbidden(f"requests from the page {origin!r} are not accepted")

    def check_role(self, scope: Scope, principal: Principal | None) -> None:
        """Raises `Unauthorized` or `Forbidden`."""
        path: str = scope["path"]
        if path == SESSION_PATH or not path.startswith(_CLOSED):
            return
        if path == METRICS_PATH and self._settings.open_metrics and is_loopback(_peer(scope)):
            return
        if principal is None:
            raise Unauthorized("show a token (Authorization: Bearer ...) or log in")
        if path.startswith(INGEST_PATH):
            if principal.role is Role.VIEWER:
                raise Forbidden(f"{principal.name} is a viewer; this needs a robot or an operator")
            return
        if principal.role is Role.ROBOT:
            raise Forbidden(f"{principal.name} is a robot, which may connect to {INGEST_PATH}MISSION alone")
        changes = scope["type"] == "http" and scope["method"] not in SAFE_METHODS
        if changes and principal.role is not Role.OPERATOR:
            raise Forbidden(f"{principal.name} is a {principal.role}; this needs an operator")


def _peer(scope: Scope) -> str:
    client = scope.get("client")
    return str(client[0]) if client else ""


def _cookie(headers: Headers) -> str | None:
    try:
        morsel = SimpleCookie("; ".join(headers.getlist("cookie"))).get(COOKIE)
    except CookieError:
        return None
    return morsel.value if morsel is not None else None


def _same_origin(origin: str, host: str, scheme: str) -> bool:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    # Behind a proxy that ends TLS, the page is https while this service hears http: the name decides.
    secure = scheme in ("https", "wss")
    return parts.netloc == host and (parts.scheme == "https" or (parts.scheme == "http" and not secure))


def _host_name(host: str) -> str | None:
    try:
        parts = urlsplit(f"//{host}")
        if parts.username is not None or parts.path or parts.query or parts.fragment:
            return None
        _ = parts.port  # raises for what is no number
        return parts.hostname
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
