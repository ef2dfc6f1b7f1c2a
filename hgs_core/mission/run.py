"""`run_mission`: from a request to a finished folder."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from hgs_core.errors import HgsError
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
from hgs_core.mission.build import MissionParts, build_mission
from hgs_core.mission.commands import CommandSource, Order
from hgs_core.mission.config import MissionConfig, resolve_mission_config
from hgs_core.mission.events import MissionObserver, MissionPhase, Notice, PhaseChanged, StopReason
from hgs_core.mission.finished_run import RUN_CONFIG
from hgs_core.mission.folder import EventLog, RunFolder
from hgs_core.mission.record import MissionRecord
from hgs_core.mission.report_page import write_report_page
from hgs_core.mission.request import MissionRequest as MissionRequest
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels


def run_mission(
    request: MissionRequest, *, observer: MissionObserver, commands: CommandSource
) -> MissionReport:
    """Run one mission and write its folder. Blocks until it has ended and been evaluated.

    An interrupted mission leaves a complete folder at once, without the mesh and the quality figures that
    take their time (`hgs mesh`, `hgs evaluate` and `hgs report` add them). Raises `ConfigError` or
    `SceneError` before anything is written; a later `HgsError` ends the mission with `failed`.
    """
    config = _resolved(request)
    kernels.set_threads(config.threads)
    folder = RunFolder(request.out)
    log = EventLog(folder.partial / "events.jsonl", observer)
    try:
        log.on_event(
            PhaseChanged(time_s=0.0, phase=MissionPhase.PREPARING, reason=f"opening scene {request.scene}")
        )
        with _discarding(folder):
            parts = build_mission(
                config, request.scene, request.seed, folder.keyframes, observer=log, commands=commands
            )
        for message in parts.scene.notices:
            log.on_event(Notice(time_s=0.0, level="warning", message=message))
        began = time.perf_counter()
        record = _run(parts)
        report = _report(request, config, parts, record, wall_s=time.perf_counter() - began)
        progress = _Progress(log, parts.world.robot.state.timestamp_s)
        _write_results(folder.partial, request, config, parts, record)
        if record.stop_reason is not StopReason.INTERRUPTED and record.poses:
            mesh = _write_mesh(folder.partial, config, progress)
            if config.evaluate:
                report = report.with_evaluation(_evaluate(config, parts, record, mesh, progress))
        report.write(folder.partial / "report.json")
        caster = parts.scene.caster if config.evaluate else None
        write_report_page(folder.partial, config, caster=caster, progress=progress)
        log.on_event(PhaseChanged(time_s=progress.time_s, phase=MissionPhase.ENDED, reason=record.message))
    finally:
        log.close()
    folder.complete()
    return report


def _resolved(request: MissionRequest) -> MissionConfig:
    overrides = dict(request.overrides)
    if request.planner is not None:
        overrides["planner"] = request.planner
    if request.max_time_s is not None:
        overrides["limits.max_time_s"] = repr(request.max_time_s)
    if request.clock is not None:
        overrides["clock"] = request.clock
    return resolve_mission_config(request.preset, overrides)


@contextmanager
def _discarding(folder: RunFolder) -> Iterator[None]:
    """A mission that cannot begin leaves nothing behind."""
    try:
        yield
    except HgsError:
        folder.discard()
        raise


def _run(parts: MissionParts) -> MissionRecord:
    try:
        return parts.mission.run()
    except HgsError as error:
        record = parts.mission.record
        record.stop_reason = StopReason.FAILED
        record.message = f"{type(error).__name__}: {error}"
        return record


@dataclass(frozen=True)
class _Progress:
    """Tells what is done after the mission."""

    log: EventLog
    time_s: float

    def __call__(self, message: str) -> None:
        self.log.on_event(PhaseChanged(time_s=self.time_s, phase=MissionPhase.EVALUATING, reason=message))


def _write_mesh(folder: Path, config: MissionConfig, progress: _Progress) -> SurfaceMesh | None:
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


def _evaluate(
    config: MissionConfig,
    parts: MissionParts,
    record: MissionRecord,
    mesh: SurfaceMesh | None,
    progress: _Progress,
) -> EvaluationResult:
    progress("comparing the map with the true surface")
    return evaluate_mission(
        scene=parts.scene,
        caster=parts.scene.caster,
        start_xy=(parts.scene.start.x_m, parts.scene.start.y_m),
        gaussians=parts.mapper.gaussians,
        mesh=mesh,
        training_poses=_batched(record.poses),
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


def _report(
    request: MissionRequest,
    config: MissionConfig,
    parts: MissionParts,
    record: MissionRecord,
    *,
    wall_s: float,
) -> MissionReport:
    state, curve = parts.world.robot.state, parts.curve
    return MissionReport.compose(
        scene=parts.scene.name,
        seed=request.seed,
        preset=request.preset,
        planner=request.planner or request.preset,
        stop_reason=str(record.stop_reason),
        stop_message=record.message,
        wall_s=wall_s,
        sim_time_s=state.timestamp_s,
        path_length_m=state.path_length_m,
        frames=len(record.poses),
        keyframes=len(parts.mapper.keyframes),
        n_gaussians=parts.mapper.gaussians.size,
        peak_rss_mib=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
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


def _write_results(
    folder: Path, request: MissionRequest, config: MissionConfig, parts: MissionParts, record: MissionRecord
) -> None:
    """Everything that needs no evaluation."""
    write_ply(parts.mapper.gaussians, folder / "map.ply")
    if len(parts.mapper.keyframes):
        parts.mapper.keyframes.write_transforms(folder / TRANSFORMS)
    parts.mapper.keyframes.drop_working_files()
    trajectory = Trajectory(timestamps_s=np.array(record.timestamps_s), poses=_batched(record.poses))
    write_trajectory(trajectory, folder / "trajectory.txt")
    content = {
        "scene": request.scene,
        "preset": request.preset,
        "planner": request.planner or request.preset,
        "seed": request.seed,
        "start": {
            "x_m": parts.scene.start.x_m,
            "y_m": parts.scene.start.y_m,
            "yaw_rad": parts.scene.start.yaw_rad,
        },
        "versions": software_versions(),
        "mission": config.model_dump(mode="json"),
    }
    partial = folder / f"{RUN_CONFIG}.partial"
    partial.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    partial.replace(folder / RUN_CONFIG)


class NoCommands:
    """A `CommandSource` without an operator."""

    def poll(self) -> Order | None:
        return None
