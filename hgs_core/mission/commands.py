"""What an operator may tell a mission that runs: typed values, and as text for a pipe or a log."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from hgs_core.planning.directives import Directives


class Command(StrEnum):
    PAUSE = "pause"
    RESUME = "resume"
    STOP = "stop"
    SUSPEND = "suspend"
    """Save a checkpoint after the frame under way, and let another process go on from it."""


@dataclass(frozen=True, kw_only=True)
class Direct:
    """What is asked of the mission from now on, whole: it takes the place of what was asked before."""

    directives: Directives


@dataclass(frozen=True, kw_only=True)
class Decide:
    """The operator's word on the view that a plan wants to drive to."""

    plan_sequence: int
    """Which plan is meant: a decision on another one than waits is void."""
    approved: bool
    candidate: int | None = None
    """Approved: drive to this candidate of the plan instead."""


Order = Command | Direct | Decide


@runtime_checkable
class CommandSource(Protocol):
    """The operator's orders, polled between iterations of the loop's steps."""

    def poll(self) -> Order | None: ...


@runtime_checkable
class PromptCommands(CommandSource, Protocol):
    """A `CommandSource` that tells of STOP at once, whatever the loop is busy with."""

    def on_stop(self, react: Callable[[], None]) -> None:
        """Call `react`, once, from another thread than the loop's, as soon as STOP comes; `poll` tells of it
        as well."""
        ...


def as_text(order: Order) -> str:
    """One line: the word of a command, JSON for what says more."""
    if isinstance(order, Command):
        return str(order)
    if isinstance(order, Direct):
        return json.dumps({"directives": order.directives.model_dump(mode="json")})
    return json.dumps(
        {
            "decision": {
                "plan_sequence": order.plan_sequence,
                "approved": order.approved,
                "candidate": order.candidate,
            }
        }
    )


def order_of(text: str) -> Order:
    """What `as_text` wrote."""
    if not text.startswith("{"):
        return Command(text)
    content = json.loads(text)
    if "directives" in content:
        return Direct(directives=Directives.model_validate(content["directives"]))
    return Decide(**content["decision"])
