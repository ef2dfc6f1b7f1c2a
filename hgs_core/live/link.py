"""The seam between a live mission and whatever carries its messages."""

from __future__ import annotations

import threading
from multiprocessing.connection import Connection
from typing import Protocol, runtime_checkable

from hgs_core.errors import StreamError


@runtime_checkable
class Link(Protocol):
    """Carries encoded messages both ways, in order."""

    name: str
    """Of the mission, as the robot is told it."""

    def send(self, content: bytes) -> None:
        """From any thread. Raises `StreamError` when the link is gone for good."""
        ...

    def receive(self, timeout_s: float) -> bytes | None:
        """The next message, or None when none came in time. Raises `StreamError` as `send` does."""
        ...


class PipeLink:
    """A link over one end of a duplex pipe to the process that holds the robot's connection."""

    def __init__(self, connection: Connection, *, name: str) -> None:
        self.name = name
        self._connection = connection
        self._sending = threading.Lock()

    def send(self, content: bytes) -> None:
        try:
            with self._sending:
                self._connection.send_bytes(content)
        except OSError as error:
            raise StreamError(f"the way to the robot is gone: {error}") from error

    def receive(self, timeout_s: float) -> bytes | None:
        try:
            return self._connection.recv_bytes() if self._connection.poll(timeout_s) else None
        except (EOFError, OSError) as error:
            raise StreamError(f"the way to the robot is gone: {error!r}") from error
