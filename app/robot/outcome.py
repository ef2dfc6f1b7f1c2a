"""How a robot's part in a mission ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto


class Outcome(Enum):
    """Why a robot's part in a mission is over."""

    ENDED = auto()
    """The mission is."""
    INTERRUPTED = auto()
    """The robot's operator wanted so."""
    GIVEN_UP = auto()
    """The service could not be reached for too long."""


@dataclass(frozen=True, kw_only=True)
class MissionWord:
    """How a mission is, as far as a robot needs to know."""

    over: str | None = None
    """Why it is over; None while it is not."""
    waits: bool = False
    """It is not under way yet: the robot waits, too, as long as it takes."""
