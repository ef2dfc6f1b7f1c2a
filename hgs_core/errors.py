"""Every error this project raises on purpose.

```text
HgsError
├── ConfigError      a preset, option or file names something that is not allowed
├── SceneError       a mesh cannot serve as a world (no triangles, no free floor, ...)
├── SensorError      a frame or scan breaks its contract
├── MapError         a map was asked for something it cannot hold or find
├── PlanningError    a planner was called in a state that it cannot plan from
├── RobotError       a robot refused or failed a command
├── StreamError      a recorded or live stream is malformed
└── CheckpointError  a saved state is torn, of another version, or does not fit
```

Expected outcomes ("nothing left to see") are return values, never errors. A message names the value,
what was expected, and what to do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any


class HgsError(Exception):
    """Base of all errors raised on purpose."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One setting that is not allowed."""

    field: str
    """Its path, `section.field`."""
    value: Any
    message: str


class ConfigError(HgsError):
    """A preset, option or file names something that is not allowed; `faults` name the settings."""

    def __init__(self, message: str, *, faults: Sequence[Fault] = ()) -> None:
        super().__init__(message)
        self.faults = tuple(faults)


class SceneError(HgsError):
    """A mesh cannot serve as a world."""


class SensorError(HgsError):
    """A frame or scan breaks its contract."""


class MapError(HgsError):
    """A map was asked for something it cannot hold or find."""


class PlanningError(HgsError):
    """A planner was called in a state that it cannot plan from."""


class RobotError(HgsError):
    """A robot refused or failed a command."""


class StreamError(HgsError):
    """A recorded or live stream is malformed."""


class CheckpointError(HgsError):
    """A saved state is torn, of another version, or does not fit."""
