"""What a pilot does without its planner: a way of its own, and an end that has been decided on."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from hgs_core.mission.events import StopReason
from hgs_core.planning.plan import UnseenRegion
from hgs_core.robot.path import Path


@dataclass(frozen=True, kw_only=True)
class Ending:
    """Why a mission ends, and what it leaves unseen."""

    reason: StopReason
    message: str
    unseen: tuple[UnseenRegion, ...]

    def state(self) -> dict[str, Any]:
        return asdict(self)

    @staticmethod
    def restore(state: dict[str, Any]) -> Ending:
        unseen = tuple(UnseenRegion.restore(entry) for entry in state["unseen"])
        return Ending(reason=StopReason(state["reason"]), message=state["message"], unseen=unseen)


@dataclass(frozen=True, kw_only=True, eq=False)
class Detour:
    """A way that no planner asked for, under way."""

    path: Path
    done: str
    """What to say at its end."""
    leaving: bool
    """It leads out of a no-go area: these do not block it."""

    def state(self) -> dict[str, Any]:
        return {"path": self.path.state(), "done": self.done, "leaving": self.leaving}

    @staticmethod
    def restore(state: dict[str, Any]) -> Detour:
        return Detour(**{**state, "path": Path(**state["path"])})
