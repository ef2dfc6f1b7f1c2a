"""Ctrl-C as an operator's STOP: what was reached is kept, in a complete folder."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from queue import SimpleQueue
from types import FrameType, TracebackType
from typing import Any, Final, Self

from hgs_core.mission.commands import Command

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)


class InterruptCommands:
    """A `CommandSource` that turns SIGINT and SIGTERM into one STOP, while used as a context manager.

    Further signals do not kill what is being written; `say` tells the operator so. Works in the main thread
    only, as signals do.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        # A handler may interrupt a print, so it must not print; filling a SimpleQueue is safe there.
        self._messages: SimpleQueue[str | None] = SimpleQueue()
        self._speaker = threading.Thread(target=self._speak, args=(say,), name="interrupts", daemon=True)
        self._stop_requested = False
        self._delivered = False
        self._previous: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Self:
        self._speaker.start()
        for number in _SIGNALS:
            self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        self._messages.put(None)
        self._speaker.join()

    def poll(self) -> Command | None:
        if self._stop_requested and not self._delivered:
            self._delivered = True
            return Command.STOP
        return None

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self._stop_requested:
            self._messages.put("already stopping: the results are being written, please wait")
        else:
            self._messages.put("stopping: what was reached is written, please wait")
        self._stop_requested = True

    def _speak(self, say: Callable[[str], None]) -> None:
        while (message := self._messages.get()) is not None:
            say(message)
