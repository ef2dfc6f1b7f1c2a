"""What is wrong with a stream, said once and not with each of its messages."""

from __future__ import annotations

from collections.abc import Callable

from hgs_core.errors import StreamError


class Complaints:
    def __init__(self, say: Callable[[str], None]) -> None:
        self.count = 0
        self._say = say
        self._last = ""

    def __call__(self, error: StreamError) -> None:
        self.count += 1
        if str(error) != self._last:
            self._last = str(error)
            self._say(self._last)
