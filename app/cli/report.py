"""`hgs report`: a finished run's page of figures, charts and pictures, made again from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.console import ERRORS, OUTPUT


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `hgs run` left behind.")],
) -> None:
    """Write report.html: one file with everything in it, to read in any browser, offline, or to print.

    Held-out views are shown where the run was evaluated (`hgs evaluate` does so afterwards), which opens its
    scene again; keyframes otherwise.

    Exit codes: 0 done, 2 the folder is not a run's, or its scene is gone.
    """
    from hgs_core.mission.report_page import REPORT_PAGE

    with ERRORS.status("reading the run") as status:
        write_report(folder, progress=status.update)
    OUTPUT.print(str(folder / REPORT_PAGE), highlight=False, soft_wrap=True)


def write_report(folder: Path, *, progress: Any) -> None:
    """Write the page of the run in `folder`. Raises an `HgsError` where there is no such run."""
    from hgs_core.evaluation.report import MissionReport
    from hgs_core.mission.finished_run import FinishedRun
    from hgs_core.mission.report_page import write_report_page
    from hgs_core.native import kernels

    run = FinishedRun.open(folder)
    kernels.set_threads(run.config.threads)
    caster = None
    if MissionReport.read(folder / "report.json").held_out_images:
        progress(f"opening {run.scene}")
        caster = run.open_scene().caster
    write_report_page(folder, run.config, caster=caster, progress=progress)
