"""The life of a mission as the service sees it.

```text
created -> (queued) -> starting -> running <-> paused
              ^           |           |          |
              |           +-----------+----------+--> stopping -> completed | failed | aborted
              |           |           |          |        |
              +------ interrupted <---+----------+--------+
```

A mission is queued when it was started while as many missions ran as may run at once.
A mission that ends by itself passes `stopping` too: that is when it evaluates and writes its folder.
A mission whose process or service ended under it is interrupted: it goes on from its last checkpoint when it
is resumed, or is given up by STOP.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final


class MissionState(StrEnum):
    CREATED = "created"
    QUEUED = "queued"
    STARTING = "starting"
    RUNNING = "running"
    PAUSED = "paused"
    STOPPING = "stopping"
    INTERRUPTED = "interrupted"
    COMPLETED = "completed"
    FAILED = "failed"
    ABORTED = "aborted"

    @property
    def ended(self) -> bool:
        return not TRANSITIONS[self]

    @property
    def active(self) -> bool:
        """Whether a mission process exists (or is about to)."""
        return self in (
            MissionState.STARTING,
            MissionState.RUNNING,
            MissionState.PAUSED,
            MissionState.STOPPING,
        )


_ENDS = frozenset({MissionState.COMPLETED, MissionState.FAILED, MissionState.ABORTED})
_BROKEN_OFF = _ENDS | {MissionState.INTERRUPTED}

TRANSITIONS: Final[dict[MissionState, frozenset[MissionState]]] = {
    MissionState.CREATED: frozenset({MissionState.QUEUED, MissionState.STARTING, MissionState.ABORTED}),
    MissionState.QUEUED: frozenset({MissionState.STARTING, MissionState.ABORTED}),
    MissionState.STARTING: frozenset({MissionState.RUNNING, MissionState.STOPPING}) | _BROKEN_OFF,
    MissionState.RUNNING: frozenset({MissionState.PAUSED, MissionState.STOPPING}) | _BROKEN_OFF,
    MissionState.PAUSED: frozenset({MissionState.RUNNING, MissionState.STOPPING}) | _BROKEN_OFF,
    MissionState.STOPPING: _BROKEN_OFF,
    # Completed, failed: its process had come to its end, as is found out when it is resumed.
    MissionState.INTERRUPTED: frozenset({MissionState.QUEUED, MissionState.STARTING}) | _ENDS,
    MissionState.COMPLETED: frozenset(),
    MissionState.FAILED: frozenset(),
    MissionState.ABORTED: frozenset(),
}
"""Which state may follow which."""

COMMANDS: Final[dict[str, frozenset[MissionState]]] = {
    "start": frozenset({MissionState.CREATED}),
    "pause": frozenset({MissionState.RUNNING}),
    "resume": frozenset({MissionState.PAUSED, MissionState.INTERRUPTED}),
    "stop": frozenset(MissionState),
}
"""In which states an operator's command makes sense; stop always does."""

DIRECTABLE: Final = frozenset(MissionState) - _ENDS - {MissionState.STOPPING}
"""In which states directives can still change something."""


def commands_allowed(state: MissionState) -> list[str]:
    """What an operator may usefully do now, in the order of a toolbar."""
    return [
        command
        for command, states in COMMANDS.items()
        if state in states and not (command == "stop" and (state.ended or state is MissionState.STOPPING))
    ]
