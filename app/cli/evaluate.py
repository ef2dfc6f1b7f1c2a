"""`hgs evaluate`: the figures of a finished run, computed again from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.report_table import report_table
from hgs_core.config.presets import load_yaml
from hgs_core.errors import ConfigError

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
    if not folder.is_dir():
        raise ConfigError(f"{folder} is not a folder: give one that `hgs run` left behind")
    from hgs_core.evaluation.mission import evaluate_mission
    from hgs_core.evaluation.report import MissionReport
    from hgs_core.evaluation.trajectory import read_trajectory
    from hgs_core.gaussians.ply import read_ply
    from hgs_core.mapping.mesh_file import read_mesh
    from hgs_core.mission.config import mission_config_from
    from hgs_core.native import kernels
    from hgs_core.scene.scene import open_scene

    report = MissionReport.read(folder / "report.json")
    content = run_config(folder / "config.yaml")
    config = mission_config_from(content["mission"], source=str(folder / "config.yaml"))
    gaussians = read_ply(folder / "map.ply")
    mesh = read_mesh(folder / "mesh.ply") if (folder / "mesh.ply").is_file() else None
    trajectory = read_trajectory(folder / "trajectory.txt")
    kernels.set_threads(config.threads)
    progress(f"opening {content['scene']}")
    scene = open_scene(content["scene"], radius_m=config.robot.radius_m, height_m=config.robot.height_m)
    evaluation = evaluate_mission(
        scene=scene,
        caster=scene.caster,
        start_xy=(float(content["start"]["x_m"]), float(content["start"]["y_m"])),
        gaussians=gaussians,
        mesh=mesh,
        training_poses=trajectory.poses,
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


def run_config(path: Path) -> dict[str, Any]:
    """The resolved configuration of a run. Raises `ConfigError` naming what is missing."""
    if not path.is_file():
        raise ConfigError(f"{path} is missing: not a folder that `hgs run` left behind")
    content = load_yaml(path)
    start = content.get("start")
    if (
        not isinstance(content.get("scene"), str)
        or not isinstance(content.get("mission"), dict)
        or not isinstance(start, dict)
        or not all(isinstance(start.get(key), (int, float)) for key in ("x_m", "y_m"))
    ):
        raise ConfigError(f"{path} must hold scene, start (x_m, y_m) and mission, as `hgs run` writes it")
    return content
