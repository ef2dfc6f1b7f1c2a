"""How many frames may be on their way, and how long each took to reach the map."""

from __future__ import annotations

from dataclasses import dataclass

from hgs_core.live.messages import Answer


@dataclass(frozen=True, kw_only=True)
class OnItsWay:
    """A frame that was sent and not answered yet."""

    taken_s: float
    """When the camera took it; likewise below by the robot's clock."""
    sent_s: float


class Credits:
    """Those of one connection: a frame costs one, an answer to it gives it back, once."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._on_their_way: dict[int, OnItsWay] = {}

    @property
    def left(self) -> int:
        return self._total - len(self._on_their_way)

    def spend(self, sequence: int, frame: OnItsWay) -> None:
        assert self.left > 0
        self._on_their_way[sequence] = frame

    def waits_s(self, now_s: float) -> float:
        """How long the oldest frame on its way has waited for its answer, where no credit is left; else 0."""
        if self.left > 0:
            return 0.0
        return now_s - min((frame.sent_s for frame in self._on_their_way.values()), default=now_s)

    def answered(self, answer: Answer) -> OnItsWay | None:
        """The frame that is meant; None for one that is not on its way: answered before, or never sent."""
        return self._on_their_way.pop(answer.sequence, None)
