"""Bearer tokens. The service keeps their SHA-256 alone: tokens are random and long, so a slow hash would add
nothing, and every request is checked.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.security.principal import ANYONE, UNKNOWN, Role
from app.settings import Settings, is_loopback
from hgs_core.errors import ConfigError

LEAST_LENGTH: Final = 20
"""Characters that a token given in words must have at least."""
_LINE: Final = re.compile(
    r"(?P<role>\S+)\s+(?P<name>[A-Za-z0-9._@-]{1,64})\s+sha256:(?P<digest>[0-9a-f]{64})"
)


@dataclass(frozen=True, kw_only=True)
class Token:
    name: str
    """Who holds it, for the audit."""
    role: Role
    digest: str
    """SHA-256 in hexadecimal."""

    @property
    def line(self) -> str:
        """As it stands in a token file."""
        return f"{self.role} {self.name} sha256:{self.digest}"


class TokenBook:
    """Every token there is."""

    def __init__(self, tokens: Iterable[Token]) -> None:
        self._tokens = tuple(tokens)

    @property
    def empty(self) -> bool:
        return not self._tokens

    def identify(self, secret: str) -> Token | None:
        """Whose token this is. Every hash is compared, in constant time."""
        digest, found = digest_of(secret), None
        for token in self._tokens:
            if hmac.compare_digest(token.digest, digest):
                found = token
        return found

    def with_digest(self, digest: str) -> Token | None:
        return next((token for token in self._tokens if token.digest == digest), None)


def new_token(role: Role, name: str) -> tuple[str, Token]:
    """A fresh secret of 256 bits, and what to keep of it. Raises `ConfigError` for a name that is not one."""
    secret = secrets.token_urlsafe(32)
    token = Token(name=name, role=role, digest=digest_of(secret))
    if _LINE.fullmatch(token.line) is None:
        raise ConfigError(f"{name!r} is no name: up to 64 letters, digits and . _ @ -")
    return secret, token


def digest_of(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def tokens_of(settings: Settings) -> TokenBook:
    """The tokens that `settings` name. Raises `ConfigError` where they would leave the service open.

    Without any, everyone who reaches the service is an operator: fine on the loopback address, and refused
    on any other.
    """
    access = settings.access
    tokens: list[Token] = []
    for variable, secret, role in (
        ("HGS_OPERATOR_TOKEN", access.operator_token, Role.OPERATOR),
        ("HGS_VIEWER_TOKEN", access.viewer_token, Role.VIEWER),
    ):
        if secret is not None:
            tokens.append(_given(variable, secret.get_secret_value(), role))
    if access.token_file is not None:
        tokens += _listed(access.token_file)
    names = [token.name for token in tokens]
    digests = {token.digest for token in tokens}
    if len(set(names)) < len(names) or len(digests) < len(names):
        raise ConfigError(f"every token needs a name and a secret of its own; there are: {', '.join(names)}")
    has_operator = any(token.role is Role.OPERATOR for token in tokens)
    if tokens and not has_operator:
        raise ConfigError("there are tokens, but none of an operator: set HGS_OPERATOR_TOKEN, too")
    if not tokens and not is_loopback(settings.host):
        raise ConfigError(
            f"will not listen on {settings.host!r} without a token, because others reach that address: set "
            "HGS_OPERATOR_TOKEN (`hgs token operator NAME` makes one), or use 127.0.0.1"
        )
    return TokenBook(tokens)


def _given(variable: str, secret: str, role: Role) -> Token:
    if len(secret) < LEAST_LENGTH or secret != secret.strip() or not secret.isascii():
        raise ConfigError(
            f"{variable} has {len(secret)} characters; a token needs at least {LEAST_LENGTH} of ASCII, "
            "without blanks around them: `openssl rand -base64 32` makes a good one"
        )
    return Token(name=str(role), role=role, digest=digest_of(secret))


def _listed(path: Path) -> list[Token]:
    tokens = []
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"the token file {path} cannot be read: {error}") from error
    for number, line in enumerate(lines, start=1):
        text = line.partition("#")[0].strip()
        if not text:
            continue
        match = _LINE.fullmatch(text)
        if match is None or match["role"] not in set(Role) or match["name"] in (ANYONE, UNKNOWN):
            raise ConfigError(
                f"{path}, line {number} is not `ROLE NAME sha256:HASH` with role viewer, robot or operator; "
                "`hgs token ROLE NAME` prints such a line"
            )
        tokens.append(Token(name=match["name"], role=Role(match["role"]), digest=match["digest"]))
    return tokens
