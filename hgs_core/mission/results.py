"""What a mission leaves once it has ended: its map, its mesh, its figures."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hgs_core.evaluation.mission import evaluate_mission
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.report_parts import PlanningCycle, Region, UnseenEntry
from hgs_core.evaluation.result import EvaluationResult
from hgs_core.evaluation.trajectory import Trajectory, write_trajectory
from hgs_core.gaussians.ply import write_ply
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mapping.mesh_file import write_mesh
from hgs_core.mapping.transforms import TRANSFORMS
from hgs_core.mapping.volume_fusion import SurfaceMesh, fuse_mesh
from hgs_core.mission.build import MissionParts
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.events import MissionPhase, Notice, PhaseChanged
from hgs_core.mission.folder import EventLog
from hgs_core.mission.old_map import write_exploration
from hgs_core.mission.record import MissionRecord
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels
from hgs_core.scene.scene import Scene


@dataclass(frozen=True)
class Progress:
    """Tells what is done after the mission."""

    log: EventLog
    time_s: float

    def __call__(self, message: str) -> None:
        self.log.on_event(PhaseChanged(time_s=self.time_s, phase=MissionPhase.EVALUATING, reason=message))


def fused_mesh(folder: Path, config: MissionConfig, progress: Progress) -> SurfaceMesh | None:
    """`mesh.ply` from the keyframes in `folder`; None where it is not wanted, or there is no surface."""
    if not config.mesh.enabled:
        return None
    mesh = fuse_mesh(KeyframeArchive.open(folder), config.mesh, progress=progress)
    if len(mesh.triangles) == 0:
        message = "no mesh: the keyframes hold no depth that makes a surface"
        progress.log.on_event(Notice(time_s=progress.time_s, level="warning", message=message))
        return None
    write_mesh(mesh, folder / "mesh.ply")
    return mesh


def evaluated(
    config: MissionConfig,
    parts: MissionParts,
    scene: Scene,
    record: MissionRecord,
    mesh: SurfaceMesh | None,
    progress: Progress,
) -> EvaluationResult:
    """The map, and `mesh` beside it, against the true scene."""
    progress("comparing the map with the true surface")
    return evaluate_mission(
        scene=scene,
        caster=scene.caster,
        start_xy=(scene.start.x_m, scene.start.y_m),
        gaussians=parts.mapper.gaussians,
        mesh=mesh,
        training_poses=_batched([*parts.mapper.keyframes.inherited, *record.poses]),
        intrinsics=config.sensor.camera.intrinsics(),
        camera_height_m=config.sensor.camera.mount_height_m,
        range_m=config.sensor.camera.range_m,
        robot_radius_m=config.robot.radius_m,
        robot_height_m=config.robot.height_m,
        progress=progress,
    )


def _batched(poses: list[SE3]) -> SE3:
    return SE3(
        rotation=np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
        translation=np.array([pose.translation for pose in poses]).reshape(-1, 3),
    )


def report_of(
    request: MissionRequest,
    config: MissionConfig,
    parts: MissionParts,
    record: MissionRecord,
    *,
    peak_rss_mib: float,
) -> MissionReport:
    """The figures that need no evaluation."""
    state, curve = parts.world.robot.state, parts.curve
    return MissionReport.compose(
        scene=parts.name,
        seed=request.seed,
        preset=request.preset,
        planner=request.planner or request.preset,
        stop_reason=str(record.stop_reason),
        stop_message=record.message,
        extends=None if request.extends is None else str(request.extends),
        wall_s=parts.mission.wall_s,
        sim_time_s=state.timestamp_s,
        path_length_m=state.path_length_m,
        frames=len(record.poses),
        keyframes=len(parts.mapper.keyframes),
        n_gaussians=parts.mapper.gaussians.size,
        peak_rss_mib=peak_rss_mib,
        planning_cycles=[
            PlanningCycle(
                viewpoint_evaluation_s=times.viewpoint_evaluation_s,
                local_s=times.local_s,
                global_s=times.global_s,
            )
            for times in record.planning
        ],
        mapping_s=record.mapping_s,
        clock=str(config.clock),
        iterations=record.iterations,
        frames_dropped=record.frames_dropped,
        frames_thinned=record.frames_thinned,
        simulation_wall_s=sum(record.sensing_s),
        collisions=state.collisions,
        unseen=[
            UnseenEntry(
                region=Region(lower_m=region.lower_m, upper_m=region.upper_m),
                volume_m3=region.volume_m3,
                reason=str(region.reason),
            )
            for region in record.unseen
        ],
        versions=software_versions(),
        kernel_variant=kernels.variant(),
        threads=config.threads,
        completion_curve=() if curve is None else curve.finished(state.path_length_m, state.timestamp_s),
        curve_wall_s=None if curve is None else curve.wall_s,
        evaluation=None,
    )


def write_results(folder: Path, config: MissionConfig, parts: MissionParts, record: MissionRecord) -> None:
    """Everything else that needs no evaluation."""
    write_ply(parts.mapper.gaussians, folder / "map.ply")
    if len(parts.mapper.keyframes):
        parts.mapper.keyframes.write_transforms(folder / TRANSFORMS)
    write_exploration(folder, config, parts.mapper, parts.planner)
    trajectory = Trajectory(timestamps_s=np.array(record.timestamps_s), poses=_batched(record.poses))
    write_trajectory(trajectory, folder / "trajectory.txt")
