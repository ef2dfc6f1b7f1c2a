"""How many optimisation steps a stretch of mission time pays for."""

from __future__ import annotations

from typing import Any


class AccruedSteps:
    """A steady rate of steps, earned as mission time passes and kept, fractions included, until spent.

    Nothing is earned before the first frame, and for any time between two frames at most what
    `at_most_s` seconds of it pay for; nor is more than that ever kept: a long wait brings no burst.
    """

    def __init__(self, rate_per_s: float, *, at_most_s: float) -> None:
        self._rate_per_s = rate_per_s
        self._most = rate_per_s * at_most_s
        self._earned = 0.0
        self._until_s: float | None = None

    def earn(self, time_s: float) -> None:
        """Mission time has come to `time_s`; what lies before the latest time so far earns nothing."""
        if self._until_s is not None:
            passed_s = max(time_s - self._until_s, 0.0)
            self._earned = min(self._earned + self._rate_per_s * passed_s, self._most)
        self._until_s = time_s if self._until_s is None else max(time_s, self._until_s)

    def spend(self) -> bool:
        """Take one step's worth; false, and nothing taken, when less is left."""
        # 0.4 s at 25 steps a second are ten steps, also where the sum of the times says 9.9999999.
        if self._earned < 1.0 - 1e-6:
            return False
        self._earned -= 1.0
        return True

    def state(self) -> dict[str, Any]:
        return {"earned": self._earned, "until_s": self._until_s}

    def restore(self, state: dict[str, Any]) -> None:
        self._earned = state["earned"]
        self._until_s = state["until_s"]
