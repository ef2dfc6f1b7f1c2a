"""How often one client may ask."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from limits import RateLimitItem, parse
from limits.storage import MemoryStorage
from limits.strategies import FixedWindowRateLimiter

from app.errors import TooMany
from app.settings import LimitSettings


class Rates:
    """Counts in memory; what was counted is forgotten with its minute."""

    def __init__(self, limits: LimitSettings) -> None:
        self._limiter = FixedWindowRateLimiter(MemoryStorage())
        self._requests = parse(limits.requests)
        self._changes = parse(limits.changes)
        self._logins = parse(limits.logins)
        self._most_streams = limits.streams
        self._streams: Counter[str] = Counter()

    def count_request(self, client: str) -> None:
        self._count(self._requests, "requests", client)

    def count_change(self, client: str) -> None:
        self._count(self._changes, "changes", client)

    def count_login(self, address: str) -> None:
        """A login that is tried, or a wrong token that was shown."""
        self._count(self._logins, "logins", address)

    @contextmanager
    def stream(self, client: str) -> Iterator[None]:
        """An open stream of `client`. Raises `TooMany`."""
        if self._streams[client] >= self._most_streams:
            raise TooMany(f"{self._most_streams} streams are open already; close one first", retry_after_s=1)
        self._streams[client] += 1
        try:
            yield
        finally:
            self._streams[client] -= 1
            if self._streams[client] == 0:
                del self._streams[client]

    def _count(self, limit: RateLimitItem, what: str, client: str) -> None:
        """Raises `TooMany`, saying when to come again."""
        if self._limiter.hit(limit, what, client):
            return
        resets_at = self._limiter.get_window_stats(limit, what, client).reset_time
        wait_s = max(1, math.ceil(resets_at - time.time()))
        raise TooMany(f"more than {limit} {what}; come again in {wait_s} s", retry_after_s=wait_s)
