"""`hgs report`: a finished run's page of figures, charts and pictures, made again from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.evaluate import run_config


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
    from hgs_core.mission.config import mission_config_from
    from hgs_core.mission.report_page import write_report_page
    from hgs_core.native import kernels
    from hgs_core.scene.scene import open_scene

    content = run_config(folder / "config.yaml")
    config = mission_config_from(content["mission"], source=str(folder / "config.yaml"))
    kernels.set_threads(config.threads)
    caster = None
    if MissionReport.read(folder / "report.json").held_out_images:
        progress(f"opening {content['scene']}")
        robot = config.robot
        caster = open_scene(content["scene"], radius_m=robot.radius_m, height_m=robot.height_m).caster
    write_report_page(folder, config, caster=caster, progress=progress)
