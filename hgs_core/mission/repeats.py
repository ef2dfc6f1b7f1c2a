"""Which events of a mission that goes on from a checkpoint were told before it broke off."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

_REPEATED: Final = frozenset({"telemetry", "plan", "notice", "ended"})
"""Kinds of events that tell what happens in the mission. All others tell what its process does."""
_INCIDENTAL: Final = frozenset(
    {
        *("wall_s", "mapping_s", "planning_s", "viewpoint_evaluation_s", "local_s", "global_s"),
        *("sequence", "received_at", "view_sequence"),
    }
)
"""What differs each time the same happens: wall times, and what a service adds."""


class Repeats:
    """What had been told of the moment that a mission goes on from, and of later ones.

    Lockstep missions live through the same again, and it would be told twice. An event that says anything
    else than one told before is no repeat: by the real clock, or after an operator's command, the mission
    takes another course, which is news.
    """

    def __init__(self, told: Iterable[Mapping[str, Any]]) -> None:
        self._told = frozenset(_said(event) for event in told if event.get("kind") in _REPEATED)

    @staticmethod
    def after(time_s: float, told: Iterable[Mapping[str, Any]]) -> Repeats:
        """Of all events in a log, those of `time_s` or later."""
        return Repeats(event for event in told if event.get("time_s", -1.0) >= time_s)

    def holds(self, event: Mapping[str, Any]) -> bool:
        return bool(self._told) and event["kind"] in _REPEATED and _said(event) in self._told


NO_REPEATS: Final = Repeats(())


def happened(log: Path, *, since_s: float, until_s: float) -> list[dict[str, Any]]:
    """What the `events.jsonl` of a run tells of what happened in its mission between two moments, the later
    one excluded; nothing where there is no such file."""
    try:
        lines = log.read_bytes().splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        try:
            event = json.loads(line)
        except ValueError:  # torn, and so the last one
            break
        if event.get("kind") in _REPEATED and since_s <= (event.get("time_s") or 0.0) < until_s:
            found.append(event)
    return found


def _said(event: Mapping[str, Any]) -> bytes:
    """A digest of what the event tells."""
    told = {key: value for key, value in event.items() if key not in _INCIDENTAL}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).digest()


def newest_course(times_s: Sequence[float]) -> Bool[ndarray, " n"]:
    """Which rows of a series, in the order that they were told in, are of the newest course of their mission:
    all but those before a row of an earlier or the same time. A mission told of them that later went back to
    a checkpoint, and took another course from there."""
    times = np.asarray(times_s, dtype=float)
    earliest_later = np.minimum.accumulate(times[::-1])[::-1]
    kept = np.ones(len(times), bool)
    kept[:-1] = times[:-1] < earliest_later[1:]
    return kept
