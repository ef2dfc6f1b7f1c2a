"""`hgs refine`: more optimisation for the map of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.evaluate import evaluate_folder
from app.cli.exit_codes import ExitCode
from app.cli.interrupts import InterruptCommands
from app.cli.report import write_report
from app.cli.report_table import report_table

if TYPE_CHECKING:
    from hgs_core.mission.refine import RefinementProgress


def refine(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `hgs run` left behind.")],
    time: Annotated[
        float, typer.Option(min=0.1, help="Wall time to spend [s]; a minute for each flat is a good start.")
    ] = 60.0,
    evaluation: Annotated[
        bool, typer.Option(help="Compare the refined map with the true scene, as `hgs evaluate` does.")
    ] = True,
) -> None:
    """Improve a run's map from the keyframes that it kept, at full resolution.

    Rewrites map.ply, report.json and report.html. Ctrl-C ends the work early and keeps what was reached; the
    map is saved every half minute besides. More time helps more: start again where it stopped.

    Exit codes: 0 done, 2 the folder is not a run's, or it kept no keyframes, 130 interrupted.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    from hgs_core.mission.finished_run import FinishedRun
    from hgs_core.mission.refine import refine_run

    config = FinishedRun.open(folder).config
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    stopped = False
    with Progress(*columns, console=ERRORS) as bar, InterruptCommands(say=bar.console.print) as commands:
        task = bar.add_task("reading the run", total=time)

        def show(done: RefinementProgress) -> None:
            bar.update(task, completed=done.elapsed_s, description=_description(done))

        def interrupted() -> bool:
            nonlocal stopped
            stopped |= commands.poll() is not None
            return stopped

        report = refine_run(folder, config, time_s=time, progress=show, interrupted=interrupted)
    if evaluation and not stopped and report.observable_fraction is not None:
        with ERRORS.status("evaluating") as status:
            report = evaluate_folder(folder, progress=status.update)
            write_report(folder, progress=status.update)
    OUTPUT.print(report_table(report))
    if stopped:
        raise typer.Exit(ExitCode.INTERRUPTED)


def _description(done: RefinementProgress) -> str:
    resolution = "full resolution" if done.full_resolution else "half resolution"
    return (
        f"{done.steps} steps, {resolution}: colour error {100 * done.colour_l1:.2f} %, "
        f"depth error {100 * done.depth_l1_m:.2f} cm"
    )
