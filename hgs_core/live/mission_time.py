"""`MissionTime`: the time of a mission that nobody can stop, but for pauses."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class MissionTime:
    """Runs from `begin` on, and stands still while `paused`. Safe to use from any thread."""

    def __init__(self, clock_s: Callable[[], float], *, earlier_s: float) -> None:
        """`earlier_s`: what an earlier process of the mission has counted."""
        self._clock_s = clock_s
        self._lock = threading.Lock()
        self._earlier_s = earlier_s
        self._began_at: float | None = None
        self._paused_at: float | None = None
        self._not_counted_s = 0.0

    def begin(self) -> None:
        """Calling it again changes nothing."""
        with self._lock:
            if self._began_at is None:
                self._began_at = self._clock_s()

    @property
    def now_s(self) -> float:
        with self._lock:
            if self._began_at is None:
                return self._earlier_s
            until = self._clock_s() if self._paused_at is None else self._paused_at
            return self._earlier_s + until - self._began_at - self._not_counted_s

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Time stands still inside."""
        with self._lock:
            began = self._paused_at = self._clock_s()
        try:
            yield
        finally:
            with self._lock:
                self._paused_at = None
                self._not_counted_s += self._clock_s() - began
