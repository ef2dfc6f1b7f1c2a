"""When to kill: random moments, spread over what missions do and over what is killed.

By the progress of the mission, not by the clock: most of a tiny one goes by before its first frame,
and how fast it gets on depends on what else the machine does.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

TARGETS = ("mission", "service", "both")
STAGES = ("starting", "preparing", "looking around", "exploring", "writing results")
"""What a mission does, in order: its process comes up, it opens its scene or checkpoint, and so on."""
LOOKING, EXPLORING, WRITING, ENDED = 2, 3, 4, 5
PATIENCE_S = 300.0
_LOOK_S = 0.01
_EARLY = 0.9
"""Moments lie in this first part of a stage, so that a stage is rarely over before they come."""


class Moments:
    def __init__(self, rng: np.random.Generator, found: Callable[[str], dict[str, Any]]) -> None:
        """`found(mission)` is what the service says of it now."""
        self._rng = rng
        self._found = found
        self._lasts_s = [0.0] * ENDED
        """Wall time of an undisturbed mission's stages."""
        self._begins_s = {LOOKING: 0.0, EXPLORING: 0.0, WRITING: 0.0}
        """Mission time at which it comes to them."""
        self._left: list[tuple[int, str]] = []

    def learn(self, mission: str) -> None:
        """Watch an undisturbed mission to its end."""
        stage, since = 0, time.monotonic()
        while stage < ENDED:
            found = self._found(mission)
            now_in = stage_of(found)
            if now_in != stage:
                self._lasts_s[stage] = time.monotonic() - since
                stage, since = now_in, time.monotonic()
                if stage in self._begins_s:
                    self._begins_s[stage] = _mission_time_s(found)
            time.sleep(_LOOK_S)

    def draw(self, number: int) -> list[tuple[int, str]]:
        """So many stages, each with what is to be killed in it, in the order in which they come.
        Drawn from all pairs in random order, then anew."""
        drawn = []
        for _ in range(number):
            if not self._left:
                pairs = [(stage, target) for stage in range(ENDED) for target in TARGETS]
                self._left = [pairs[place] for place in self._rng.permutation(len(pairs))]
            drawn.append(self._left.pop())
        return sorted(drawn)

    def wait(self, mission: str, wanted: int) -> int:
        """Wait for a random moment of that stage, or of the one the mission is in: a stage that a resumed
        mission has behind it does not come again. Returns the stage it is in then, or `ENDED`."""
        share = _EARLY * self._rng.uniform()
        reached: Callable[[dict[str, Any]], bool] | None = None
        deadline = time.monotonic() + PATIENCE_S
        while True:
            found = self._found(mission)
            stage = stage_of(found)
            if stage == ENDED:
                return ENDED
            if stage >= wanted:
                reached = reached or self._moment_of(stage, found, share)
                if reached(found):
                    return stage
            assert time.monotonic() < deadline, found
            time.sleep(_LOOK_S)

    def _moment_of(self, stage: int, found: dict[str, Any], share: float) -> Callable[[dict[str, Any]], bool]:
        """Whether the moment has come, of a mission that has just come to `stage`, or is on in it."""
        if stage in (LOOKING, EXPLORING):
            now_s = _mission_time_s(found)
            until_s = now_s + share * max(0.0, self._begins_s[stage + 1] - now_s)
            return lambda found: stage_of(found) > stage or _mission_time_s(found) >= until_s
        until = time.monotonic() + share * self._lasts_s[stage]
        return lambda found: stage_of(found) > stage or time.monotonic() >= until


def stage_of(found: dict[str, Any]) -> int:
    """Index in `STAGES` of what a mission does now; `ENDED` when it does nothing any more."""
    state, phase = found["state"], found["phase"]
    if state == "starting":
        return STAGES.index("starting" if phase is None else "preparing")
    if state == "running":
        return LOOKING if found["newest_plan"] is None else EXPLORING
    assert state in ("stopping", "completed", "failed", "aborted"), found
    return WRITING if state == "stopping" else ENDED


def _mission_time_s(found: dict[str, Any]) -> float:
    return found["figures"]["time_s"] if found["figures"] is not None else 0.0
