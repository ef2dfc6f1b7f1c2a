"""What the exit code of `hgs` says."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from hgs_core.mission.events import StopReason


class ExitCode(IntEnum):
    """1 is left to Python: an uncaught exception, that is, a defect."""

    COMPLETE = 0
    USAGE = 2
    """An option, preset, scene or file is not what it should be; nothing was run."""
    UNFINISHED = 3
    """The mission ended before all was seen: time limit, path budget, or stuck."""
    FAILED = 4
    """The mission failed on its way, or a file could not be written."""
    INTERRUPTED = 130
    """Stopped by Ctrl-C or SIGTERM; the folder is complete."""


_OF_STOP_REASON: Final = {
    StopReason.COMPLETE: ExitCode.COMPLETE,
    StopReason.STREAM_ENDED: ExitCode.COMPLETE,
    StopReason.TIME_LIMIT: ExitCode.UNFINISHED,
    StopReason.STUCK: ExitCode.UNFINISHED,
    StopReason.PATH_BUDGET: ExitCode.UNFINISHED,
    StopReason.FAILED: ExitCode.FAILED,
    StopReason.INTERRUPTED: ExitCode.INTERRUPTED,
}


def exit_code_of(stop_reason: str) -> ExitCode:
    return _OF_STOP_REASON[StopReason(stop_reason)]
