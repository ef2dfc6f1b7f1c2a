"""What a robot leaves: its report, its figures, where it was, and the map that came of it."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from app.missions.states import MissionState
from app.robot.camera import TakenFrame
from app.robot.rest import ServiceApi
from hgs_core.errors import RobotError
from hgs_core.evaluation.mission import evaluate_mission
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.result import EvaluationResult
from hgs_core.evaluation.trajectory import Trajectory, write_trajectory
from hgs_core.gaussians.ply import read_ply
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.mesh_file import read_mesh
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.events import StopReason
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels
from hgs_core.scene.scene import Scene

_POLL_S: Final = 1.0
_STOP_REASONS: Final = {
    MissionState.COMPLETED: StopReason.COMPLETE,
    MissionState.FAILED: StopReason.FAILED,
}


def finished_mission(
    api: ServiceApi, mission: str, *, patience_s: float, say: Callable[[str], None]
) -> dict[str, Any]:
    """The mission's detail once it has written its results, which takes a while: mesh, evaluation.

    Raises `RobotError` when that takes longer than `patience_s`, or the service refuses, and `OSError` when
    it does not answer.
    """
    deadline_s, told = time.monotonic() + patience_s, ""
    while not MissionState((detail := api.mission(mission))["state"]).ended:
        if detail["reason"] != told:
            told = str(detail["reason"])
            say(f"the mission is {detail['state']}: {told}")
        if time.monotonic() > deadline_s:
            raise RobotError(f"mission {mission} is still {detail['state']} after {patience_s:g} s: {told}")
        time.sleep(_POLL_S)
    return detail


def download_results(api: ServiceApi, mission: str, folder: Path) -> MissionReport | None:
    """map.ply and mesh.ply into `folder`, where the mission has left them; its own report, if any."""
    there = api.results(mission)
    for name in sorted(there & {"map.ply", "mesh.ply"}):
        api.download(mission, name, folder / name)
    if "report.json" not in there:
        return None
    with tempfile.TemporaryDirectory(prefix="hgs-robot-") as place:
        api.download(mission, "report.json", Path(place) / "report.json")
        return MissionReport.read(Path(place) / "report.json")


def evaluated(
    scene: Scene,
    config: MissionConfig,
    folder: Path,
    taken: Collection[TakenFrame],
) -> EvaluationResult | None:
    """The downloaded map against the true scene, seen from where the frames that it took were truly taken;
    None without a map or such frames."""
    if not (folder / "map.ply").is_file() or not taken:
        return None
    kernels.set_threads(config.threads)
    return evaluate_mission(
        scene=scene,
        caster=scene.caster,
        start_xy=(scene.start.x_m, scene.start.y_m),
        gaussians=read_ply(folder / "map.ply"),
        mesh=read_mesh(folder / "mesh.ply") if (folder / "mesh.ply").is_file() else None,
        training_poses=batched([frame.T_world_camera for frame in taken]),
        intrinsics=config.sensor.camera.intrinsics(),
        camera_height_m=config.sensor.camera.mount_height_m,
        range_m=config.sensor.camera.range_m,
        robot_radius_m=config.robot.radius_m,
        robot_height_m=config.robot.height_m,
    )


def report_of(
    theirs: MissionReport | None,
    detail: Mapping[str, Any] | None,
    *,
    own: Mapping[str, Any],
    message: str,
) -> MissionReport:
    """`report.json` with a mission's keys. `own` is what the robot itself knows, and counts; what only the
    service knows (keyframes, planning, ...) is from its report, `theirs`, where there is one."""
    if theirs is not None:
        return MissionReport.model_validate({**theirs.model_dump(by_alias=True), **own})
    state = MissionState.ABORTED if detail is None else MissionState(detail["state"])
    reason = None if detail is None else detail["stop_reason"]
    return MissionReport(
        stop_reason=reason or str(_STOP_REASONS.get(state, StopReason.INTERRUPTED)),
        stop_message=message if detail is None else str(detail["reason"]),
        keyframes=0,
        n_gaussians=0,
        versions=software_versions(),
        kernel_variant=kernels.variant(),
        threads=kernels.threads(),
        **own,
    )


def write_paths(folder: Path, taken: Collection[TakenFrame]) -> None:
    """trajectory.txt, where the frames were truly taken, and estimated.txt, where the robot believed."""
    times = np.array([frame.timestamp_s for frame in taken])
    for name, poses in (
        ("trajectory.txt", [frame.T_world_camera for frame in taken]),
        ("estimated.txt", [frame.estimate for frame in taken]),
    ):
        write_trajectory(Trajectory(timestamps_s=times, poses=batched(poses)), folder / name)


def batched(poses: list[SE3]) -> SE3:
    return SE3(
        rotation=np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
        translation=np.array([pose.translation for pose in poses]).reshape(-1, 3),
    )
