"""`hgs evaluate`: the figures of a finished run, computed again from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.report_table import report_table

if TYPE_CHECKING:
    from hgs_core.evaluation.report import MissionReport


def evaluate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `hgs run` left behind.")],
) -> None:
    """Compare a run's map with the true scene again, and rewrite the quality figures of its report.json.

    Reads config.yaml, map.ply, mesh.ply where there is one, trajectory.txt and report.json; what the mission
    itself did stays as it was. This also gives an interrupted run its figures; `hgs report`
    then shows them.

    Exit codes: 0 done, 2 the folder is not a run's.
    """
    with ERRORS.status("reading the run") as status:
        report = evaluate_folder(folder, progress=status.update)
    OUTPUT.print(report_table(report))


def evaluate_folder(folder: Path, *, progress: Any) -> MissionReport:
    """Evaluate the run in `folder`, write its `report.json`, and return it.

    Raises an `HgsError` where there is no such run.
    """
    from hgs_core.evaluation.mission import evaluate_mission
    from hgs_core.evaluation.report import MissionReport
    from hgs_core.gaussians.ply import read_ply
    from hgs_core.mapping.mesh_file import read_mesh
    from hgs_core.mission.finished_run import FinishedRun
    from hgs_core.mission.old_map import training_poses
    from hgs_core.native import kernels

    run = FinishedRun.open(folder)
    config = run.config
    report = MissionReport.read(folder / "report.json")
    gaussians = read_ply(folder / "map.ply")
    mesh = read_mesh(folder / "mesh.ply") if (folder / "mesh.ply").is_file() else None
    seen_from = training_poses(folder)
    kernels.set_threads(config.threads)
    progress(f"opening {run.scene}")
    scene = run.open_scene()
    evaluation = evaluate_mission(
        scene=scene,
        caster=scene.caster,
        start_xy=run.start_xy,
        gaussians=gaussians,
        mesh=mesh,
        training_poses=seen_from,
        intrinsics=config.sensor.camera.intrinsics(),
        camera_height_m=config.sensor.camera.mount_height_m,
        range_m=config.sensor.camera.range_m,
        robot_radius_m=config.robot.radius_m,
        robot_height_m=config.robot.height_m,
        progress=progress,
    )
    renewed = report.with_evaluation(evaluation)
    renewed.write(folder / "report.json")
    return renewed
