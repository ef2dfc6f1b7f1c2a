"""The operator, as the loop knows them: what was said so far, and what of it is still to be acted on."""

from __future__ import annotations

from hgs_core.mission.commands import Command, CommandSource, Decide, Direct, Order, as_text, order_of
from hgs_core.planning.directives import Directives


class Operator:
    """Listens whenever it is asked to. STOP counts at once; the rest waits for the boundary of a step."""

    def __init__(self, source: CommandSource) -> None:
        self.stop_requested = False
        self.pause_requested = False
        self.suspend_requested = False
        self._source = source
        self._directives: Directives | None = None
        self._decision: Decide | None = None

    @property
    def wants_an_end(self) -> bool:
        """Of the mission, or of this process."""
        return self.stop_requested or self.suspend_requested

    @property
    def has_news(self) -> bool:
        """Whether anything waits to be acted on."""
        return (
            self.wants_an_end
            or self.pause_requested
            or self._directives is not None
            or self._decision is not None
        )

    def listen(self) -> None:
        """Hear everything that has been said; of directives and decisions the last one counts."""
        while (order := self._source.poll()) is not None:
            self._hear(order)

    def take_directives(self) -> Directives | None:
        """What is asked of the mission from now on, where that is new."""
        taken, self._directives = self._directives, None
        return taken

    def take_decision(self, plan_sequence: int) -> Decide | None:
        """The word on that plan's view; words on other plans are void."""
        taken, self._decision = self._decision, None
        return taken if taken is not None and taken.plan_sequence == plan_sequence else None

    def _hear(self, order: Order) -> None:
        if isinstance(order, Direct):
            self._directives = order.directives
        elif isinstance(order, Decide):
            self._decision = order
        else:
            self.stop_requested |= order is Command.STOP
            self.suspend_requested |= order is Command.SUSPEND
            self.pause_requested = order is Command.PAUSE

    def state(self) -> list[str]:
        """What was heard and not acted on yet, as texts."""
        waiting = [] if self._directives is None else [as_text(Direct(directives=self._directives))]
        return waiting if self._decision is None else [*waiting, as_text(self._decision)]

    def restore(self, state: list[str]) -> None:
        for text in state:
            self._hear(order_of(text))
