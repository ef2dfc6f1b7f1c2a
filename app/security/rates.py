"""How often one client may ask."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from limits import RateLimitItem, parse

from app.errors import TooMany
from app.settings import LimitSettings


class Rates:
    """Counts in memory; what was counted is forgotten with its minute."""

    def __init__(self, limits: LimitSettings) -> None:
        self._requests = _Windows(parse(limits.requests), "requests")
        self._changes = _Windows(parse(limits.changes), "changes")
        self._logins = _Windows(parse(limits.logins), "logins")
        self._most_streams = limits.streams
        self._streams: Counter[str] = Counter()

    def count_request(self, client: str) -> None:
        self._requests.count(client, time.monotonic())

    def count_change(self, client: str) -> None:
        self._changes.count(client, time.monotonic())

    def count_login(self, address: str) -> None:
        """A login that is tried, or a wrong token that was shown."""
        self._logins.count(address, time.monotonic())

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


@dataclass
class _Window:
    ends_at_s: float
    counted: int = 0


class _Windows:
    """Of each client, a window of fixed length from its first request on; safe to use from any thread.

    The storage of `limits` starts a thread for every request to forget old ones; that costs more than most
    answers do. Here the next request forgets them: they all last equally long, so the oldest end first.
    """

    def __init__(self, limit: RateLimitItem, what: str) -> None:
        self._limit = limit
        self._what = what
        self._lasts_s = float(limit.get_expiry())
        self._by_client: dict[str, _Window] = {}
        self._lock = threading.Lock()

    def count(self, client: str, now_s: float) -> None:
        """Raises `TooMany`, saying when to come again."""
        with self._lock:
            self._forget(now_s)
            window = self._by_client.setdefault(client, _Window(now_s + self._lasts_s))
            window.counted += 1
            if window.counted <= self._limit.amount:
                return
        wait_s = max(1, math.ceil(window.ends_at_s - now_s))
        raise TooMany(f"more than {self._limit} {self._what}; come again in {wait_s} s", retry_after_s=wait_s)

    def _forget(self, now_s: float) -> None:
        while self._by_client:
            oldest = next(iter(self._by_client))
            if self._by_client[oldest].ends_at_s > now_s:
                return
            del self._by_client[oldest]
