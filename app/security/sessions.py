"""Logins of browsers: a random secret in a cookie stands for a token until it expires."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from app.security.tokens import Token, TokenBook, digest_of
from app.storage.logins import LoginStore
from app.storage.tables import LoginRow


@dataclass(frozen=True, kw_only=True)
class Session:
    digest: str
    """SHA-256 of its secret."""
    token: Token
    expires_at: float
    """Unix time [s]."""


class SessionBook:
    """Sessions that hold. One ends with its time, with a logout, and when its token is no longer there."""

    def __init__(
        self,
        tokens: TokenBook,
        store: LoginStore,
        *,
        lifetime_s: float,
        now: Callable[[], float] = time.time,
    ) -> None:
        self._store = store
        self._lifetime_s = lifetime_s
        self._now = now
        self._lock = threading.Lock()
        self._sessions: dict[str, Session] = {}
        for row in store.all():
            token = tokens.with_digest(row.token_digest)
            if token is not None:
                self._sessions[row.secret_digest] = Session(
                    digest=row.secret_digest, token=token, expires_at=row.expires_at
                )

    def open(self, token: Token) -> tuple[str, Session]:
        """A new session and its secret, which is kept nowhere."""
        secret, now = secrets.token_urlsafe(32), self._now()
        session = Session(digest=digest_of(secret), token=token, expires_at=now + self._lifetime_s)
        row = LoginRow(
            secret_digest=session.digest,
            token_digest=token.digest,
            opened_at=now,
            expires_at=session.expires_at,
        )
        self._store.add(row, now=now)
        with self._lock:
            expired = [digest for digest, known in self._sessions.items() if known.expires_at <= now]
            for digest in expired:
                del self._sessions[digest]
            self._sessions[session.digest] = session
        return secret, session

    def find(self, secret: str) -> Session | None:
        return self.with_digest(digest_of(secret))

    def with_digest(self, digest: str) -> Session | None:
        with self._lock:
            session = self._sessions.get(digest)
        return session if session is not None and session.expires_at > self._now() else None

    def close(self, digest: str) -> None:
        with self._lock:
            self._sessions.pop(digest, None)
        self._store.delete(digest)
