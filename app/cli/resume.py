"""`hgs resume`: a run that was killed goes on from its last checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.run import run_and_tell


def resume(
    out: Annotated[
        Path, typer.Argument(metavar="DIR", help="The folder that was named to `hgs run` as --out.")
    ],
) -> None:
    """Go on with a run whose process was killed, from its last checkpoint to its end.

    By the lockstep clock the run ends as one that was not interrupted: the same trajectory, map and figures.
    Settings are those that it was begun with.

    Exit codes: those of `hgs run`; 2 also where there is nothing to go on from.
    """
    from hgs_core.mission.finished_run import resuming_request  # takes a second: not for --help

    raise typer.Exit(run_and_tell(resuming_request(out)))
