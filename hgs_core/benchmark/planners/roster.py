"""The planners that the paper compares, and what each of its variants has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, kw_only=True)
class PlannerEntry:
    """How a planner preset is called in tables."""

    preset: str
    label: str = ""
    """What the paper calls it; empty for others."""
    marks: tuple[bool, bool, bool, bool] = (False, False, False, False)
    """Coverage gain, quality gain, hierarchy, adaptive weight (the paper's Table I)."""


MARKS: Final = ("Cov.", "Qua.", "Hier.", "Adap.")

VARIANTS: Final = (
    PlannerEntry(preset="tare", label="V1 (TARE)", marks=(False, False, True, False)),
    PlannerEntry(preset="coverage", label="V2 (coverage)", marks=(True, False, True, False)),
    PlannerEntry(preset="quality", label="V3 (quality)", marks=(False, True, True, False)),
    PlannerEntry(preset="both", label="V4 (both)", marks=(True, True, True, False)),
    PlannerEntry(preset="paper", label="V5 (full)", marks=(True, True, True, True)),
)
"""Rows of Table I."""

BEST: Final = PlannerEntry(preset="best", label="beyond the paper", marks=(True, True, True, True))

METHODS: Final = (
    PlannerEntry(preset="gs-planner", label="GS-Planner"),
    PlannerEntry(preset="naruto", label="NARUTO"),
    PlannerEntry(preset="paper", label="HGS-Planner"),
)
"""Rows of Table II."""

THE_PAPERS: Final = (*(entry.preset for entry in VARIANTS), "gs-planner", "naruto")
"""The paper's seven planners."""

COMPARED: Final = (*THE_PAPERS, BEST.preset)
"""What `hgs bench planners` runs unless planners are named."""


def further(planners: Sequence[str]) -> list[PlannerEntry]:
    """Entries of the planners that stand in neither of the paper's tables."""
    return [PlannerEntry(preset=name) for name in planners if name not in COMPARED]


def every(planners: Sequence[str]) -> list[PlannerEntry]:
    """Entries of all `planners`, the paper's first."""
    named = {entry.preset: entry for entry in (*METHODS, *VARIANTS, BEST)}
    known = [named[name] for name in COMPARED if name in planners]
    return [*known, *further(planners)]
