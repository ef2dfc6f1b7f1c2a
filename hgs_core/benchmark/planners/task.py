"""What the process of one cell is told, and what it answers: plain data, one line of JSON each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

RUN_MISSION: Final = "hgs_core.mission.run:run_mission"


@dataclass(frozen=True, kw_only=True)
class CellTask:
    """Everything that a cell's process needs; every path is absolute."""

    name: str
    """Tells tasks of a grid apart."""
    scene: str
    """`house`, `house:SEED` or a mesh file."""
    preset: str
    planner: str
    seed: int
    overrides: dict[str, str]
    out: str
    log: str
    threads: int
    kernel_variant: str
    """What this process and its software must be, so that cells are comparable; likewise below."""
    versions: dict[str, str]
    commit: str
    runner: str = RUN_MISSION
    """`module:function` with the signature of `run_mission`."""


@dataclass(frozen=True, kw_only=True)
class CellAnswer:
    """How a cell's process ended."""

    failure: str | None = None
    """None: its folder is complete."""
    processor: str | None = None
    """None: it ended without a word."""
