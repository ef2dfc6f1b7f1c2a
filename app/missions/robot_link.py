"""`RobotLink`: between a robot's connection and the process of its mission."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Final, Protocol

from hgs_core.errors import StreamError
from hgs_core.live.checks import MessageChecks, refusal_of
from hgs_core.live.messages import (
    Answer,
    Bye,
    FollowPath,
    Frame,
    FromRobot,
    Hello,
    Report,
    Stop,
    ToRobot,
    encoded,
    from_robot,
    to_robot,
)

log = logging.getLogger(__name__)

_FRAMES_WAITING: Final = 2
_MOST_WAITING: Final = 2000
_WAITING_BYTES: Final = 16 * 2**20


class Receiver(Protocol):
    """A robot's connection, told from other threads."""

    def deliver(self, content: bytes, *, urgent: bool = False) -> None:
        """Send it; what is `urgent` in place of everything that waits to be sent."""
        ...

    def dismiss(self, code: int, reason: str) -> None:
        """End the connection."""
        ...


@dataclass(frozen=True, kw_only=True)
class LinkFigures:
    """What has gone over a link so far."""

    robot: str | None = None
    """The name in its newest hello."""
    connected: bool = False
    connections: int = 0
    frames: int = 0
    """Well-formed ones."""
    frames_dropped: int = 0
    """Of these, how many never reached the mission, being overtaken by newer ones."""
    missed: int = 0
    """Reports and clouds that never reached it, as its process did not read for long."""
    refused: int = 0
    """Messages that broke the protocol."""
    heard_at: float | None = None
    """When the newest message came, Unix time [s]."""


class RobotLink:
    """Checks what comes before it is passed on. Frames that the process does not take in time are dropped,
    the oldest first; everything else waits, in order. Of several connections the newest counts. Thread-safe.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Condition()
        self._receiver: Receiver | None = None
        self._checks = MessageChecks()
        self._waiting: deque[tuple[bytes, int | None]] = deque()
        """Encoded messages; with a frame its sequence."""
        self._waiting_bytes = 0
        self._n_frames = 0
        """How many of those that wait are frames."""
        self._figures = LinkFigures()
        self._report: Report | None = None
        self._command: FollowPath | Stop | None = None
        self._closed = False

    def begin(self) -> None:
        for run, name in ((self._write, "robot-link-writer"), (self._read, "robot-link-reader")):
            threading.Thread(target=run, name=name, daemon=True).start()

    def close(self, reason: str) -> None:
        """The mission's process is gone: the robot is told to stand, and let go."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
            receiver, self._receiver = self._receiver, None
            self._clear()
            self._lock.notify_all()
        if receiver is not None:
            receiver.deliver(encoded(self._stop(reason)), urgent=True)
            receiver.dismiss(CLOSED, reason)
        with contextlib.suppress(OSError):
            self._connection.close()

    def connect(self, receiver: Receiver) -> bool:
        """Let this connection be the robot's from now on; false where the mission's process is gone."""
        with self._lock:
            if self._closed:
                return False
            before, self._receiver = self._receiver, receiver
            self._checks = MessageChecks()
            self._figures = replace(self._figures, connected=True, connections=self._figures.connections + 1)
        if before is not None:
            before.deliver(encoded(self._stop("another connection took this one's place")), urgent=True)
            before.dismiss(REPLACED, "another connection of the robot took its place")
        return True

    def disconnect(self, receiver: Receiver) -> None:
        with self._lock:
            if self._receiver is receiver:
                self._receiver = None
                self._figures = replace(self._figures, connected=False)

    def take(self, receiver: Receiver, content: bytes) -> None:
        """Check a message of the robot's and pass it on, or say why not."""
        with self._lock:
            if self._receiver is not receiver or self._closed:
                return
            message: FromRobot | None = None
            try:
                message = from_robot(content)
                self._checks.admit(message)
            except StreamError as error:
                self._figures = replace(self._figures, refused=self._figures.refused + 1)
                answer: ToRobot | None = refusal_of(message, str(error), now_s=time.monotonic())
            else:
                answer = self._queue(message, content)
        if answer is not None:
            receiver.deliver(encoded(answer))

    def halt(self, reason: str) -> None:
        """Tell the robot to stand, now, whatever the mission's process is busy with."""
        with self._lock:
            receiver = self._receiver
        if receiver is not None:
            receiver.deliver(encoded(self._stop(reason)), urgent=True)

    @property
    def figures(self) -> LinkFigures:
        return self._figures

    @property
    def report(self) -> Report | None:
        """The robot's newest."""
        return self._report

    @property
    def command(self) -> FollowPath | Stop | None:
        """The newest that moves the robot or lets it stand."""
        return self._command

    def _queue(self, message: FromRobot, content: bytes) -> ToRobot | None:
        figures = replace(self._figures, heard_at=time.time())
        answer: ToRobot | None = None
        sequence = message.sequence if isinstance(message, Frame) else None
        if isinstance(message, Hello):
            self._clear()  # it begins anew
            figures = replace(figures, robot=message.name)
            self._report = message.report or self._report
        elif isinstance(message, Report):
            self._report = message
        is_full = len(self._waiting) >= _MOST_WAITING or self._waiting_bytes >= _WAITING_BYTES
        if sequence is not None:
            figures = replace(figures, frames=figures.frames + 1)
            overtaken = sequence if is_full else self._overtaken()
            if overtaken is not None:
                figures = replace(figures, frames_dropped=figures.frames_dropped + 1)
                answer = Answer(now_s=time.monotonic(), sequence=overtaken, fate="dropped")
        if not is_full or isinstance(message, Bye):  # a goodbye gets through
            self._waiting.append((content, sequence))
            self._waiting_bytes += len(content)
            self._n_frames += sequence is not None
            self._lock.notify_all()
        elif sequence is None:
            figures = replace(figures, missed=figures.missed + 1)
        self._figures = figures
        return answer

    def _overtaken(self) -> int | None:
        """The frame that makes room for a new one, taken out; None where there is room."""
        if self._n_frames < _FRAMES_WAITING:
            return None
        oldest = next(entry for entry in self._waiting if entry[1] is not None)
        self._waiting.remove(oldest)
        self._count_out(*oldest)
        return oldest[1]

    def _count_out(self, content: bytes, sequence: int | None) -> None:
        self._waiting_bytes -= len(content)
        self._n_frames -= sequence is not None

    def _clear(self) -> None:
        self._waiting.clear()
        self._waiting_bytes = self._n_frames = 0

    def _write(self) -> None:
        while True:
            with self._lock:
                self._lock.wait_for(lambda: bool(self._waiting) or self._closed)
                if self._closed:
                    return
                content, sequence = self._waiting.popleft()
                self._count_out(content, sequence)
            try:
                self._connection.send_bytes(content)
            except OSError:  # the process has gone: its supervisor closes this
                return

    def _read(self) -> None:
        while True:
            try:
                content = self._connection.recv_bytes()
            except (EOFError, OSError):  # the process has gone: its supervisor closes this
                return
            message = to_robot(content)
            with self._lock:
                if isinstance(message, FollowPath | Stop):
                    self._command = message
                receiver = self._receiver
            if receiver is not None:
                receiver.deliver(content)

    def _stop(self, reason: str) -> Stop:
        command = 0 if self._command is None else self._command.command
        return Stop(now_s=time.monotonic(), command=command, reason=reason)


REPLACED: Final = 4409
CLOSED: Final = 4410
NO_MORE: Final = 4411
