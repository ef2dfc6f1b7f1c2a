"""Who is asking, and in which role."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from starlette.types import Scope

ANYONE: Final = "anyone"
"""The name of everybody where no token is set."""
UNKNOWN: Final = "unknown"


class Role(StrEnum):
    VIEWER = "viewer"
    """Sees everything, changes nothing."""
    OPERATOR = "operator"
    ROBOT = "robot"
    """Sends frames to missions and takes their commands; sees and changes nothing else."""


class Proof(StrEnum):
    """How somebody showed who they are."""

    NONE_NEEDED = "none needed"
    TOKEN = "token"
    SESSION = "session"


@dataclass(frozen=True, kw_only=True)
class Principal:
    name: str
    """Of the token."""
    role: Role
    proof: Proof
    session: str | None = None
    """Digest of the session's secret."""
    expires_at: float | None = None
    """Unix time [s]; None = as long as the service runs."""

    @property
    def client(self) -> str:
        """Whose share of the limits a request is taken from."""
        return f"session {self.session}" if self.session is not None else f"{self.proof} {self.name}"


_KEY: Final = "hgs.principal"


def set_principal(scope: Scope, principal: Principal | None) -> None:
    scope[_KEY] = principal


def principal_of(scope: Scope) -> Principal | None:
    """Who sent this request; None where nobody has to say so (see `app.security.access`)."""
    found: Principal | None = scope.get(_KEY)
    return found
