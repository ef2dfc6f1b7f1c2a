"""What is asked of a mission."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class MissionRequest:
    """What to run, and where to leave the results."""

    scene: str
    """`house`, `house:SEED`, or another name, a mesh file or the folder of a scan."""
    preset: str
    seed: int
    out: Path
    max_time_s: float | None
    """Mission time [s]; None = the preset's limit."""
    overrides: dict[str, str]
    """`section.key` -> YAML text, applied on top of the preset."""
    planner: str | None = None
    """A planner preset in place of the mission preset's."""
    clock: str | None = None
    """`lockstep` or `real`; None = the preset's."""
    extends: Path | None = None
    """Folder of a finished run of the same scene whose maps the mission begins with."""
    resume: bool = False
    """Go on from what a process that was killed or suspended left for `out`; from the start where it left
    nothing to go on from."""
