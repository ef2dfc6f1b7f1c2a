"""Logs of the service and of its mission processes: one event a line, for people or for programs.

Everything logs through the standard library (`logging.getLogger(__name__)`, facts as `extra`), uvicorn and
other libraries too; structlog shapes what comes out. What is bound with `structlog.contextvars` (the request,
the mission) stands in every line that is written meanwhile.
"""

from __future__ import annotations

import logging
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import IO, Any, Final

import structlog
from structlog.typing import EventDict, Processor, WrappedLogger

RECENT: Final = 2_000
"""Lines that the service keeps for a report of a fault."""


class LogStyle(StrEnum):
    CONSOLE = "console"
    """To read."""
    JSON = "json"
    """One JSON object a line."""


class LogLevel(StrEnum):
    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


def configure_logging(
    style: LogStyle, level: LogLevel, *, stream: IO[str] | None = None, **facts: str
) -> None:
    """Send all logs of this process to `stream` (standard error); `facts` stand in every line."""
    handler = logging.StreamHandler(stream or sys.stderr)
    handler.setFormatter(_formatter(style, facts, colours=handler.stream.isatty()))
    root = logging.getLogger()
    for previous in [h for h in root.handlers if h.name == __name__]:
        root.removeHandler(previous)
    handler.name = __name__
    root.addHandler(handler)
    root.setLevel(str(level).upper())


class RecentLogs(logging.Handler):
    """The newest lines of this process in memory, as JSON."""

    def __init__(self) -> None:
        super().__init__()
        self._lines: deque[str] = deque(maxlen=RECENT)
        self.setFormatter(_formatter(LogStyle.JSON, {}))

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._lines.append(self.format(record))
        except Exception:
            self.handleError(record)

    def lines(self) -> list[str]:
        """Oldest first."""
        return list(self._lines)

    @contextmanager
    def listening(self) -> Iterator[None]:
        root = logging.getLogger()
        root.addHandler(self)
        try:
            yield
        finally:
            root.removeHandler(self)


class _Facts:
    def __init__(self, facts: dict[str, str]) -> None:
        self._facts = facts

    def __call__(self, logger: WrappedLogger, name: str, event: EventDict) -> EventDict:
        return {**self._facts, **event}


def _without_copies(logger: WrappedLogger, name: str, event: EventDict) -> EventDict:
    """Another handler's formatter may have left the text in the record, as if it were a fact of its own."""
    event.pop("message", None)
    return event


def _formatter(style: LogStyle, facts: dict[str, str], *, colours: bool = False) -> logging.Formatter:
    shaped: list[Processor] = [
        _Facts(facts),
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_logger_name,
        structlog.stdlib.add_log_level,
        structlog.stdlib.ExtraAdder(),
        _without_copies,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    if style is LogStyle.JSON:
        # A plain traceback: other renderers add the values of local variables, and one may be a token.
        last: list[Processor] = [
            structlog.processors.format_exc_info,
            structlog.processors.JSONRenderer(default=_plain),
        ]
    else:
        last = [
            structlog.dev.ConsoleRenderer(
                colors=colours, exception_formatter=structlog.dev.plain_traceback, pad_event_to=0
            )
        ]
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=shaped,
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last],
    )


def _plain(value: Any) -> str:
    return str(value)
