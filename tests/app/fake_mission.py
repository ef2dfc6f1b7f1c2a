"""Mission runners without a simulator: quick, deterministic, and some that misbehave.

The real child process, transport, service and viewer run around them. `runner(NAME)` is what
`create_app(settings, runner=...)` takes.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np

from hgs_core.errors import SceneError
from hgs_core.gain.viewpoint import GainPanorama
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.mission.commands import Command, Decide, Direct
from hgs_core.mission.events import (
    ApprovalChanged,
    ApprovalState,
    DirectivesTaken,
    MissionEnded,
    MissionPhase,
    MissionView,
    Notice,
    PhaseChanged,
    PlanMade,
    Resumed,
    StopReason,
    Telemetry,
)
from hgs_core.mission.folder import EventLog
from hgs_core.planning.directives import Directives
from hgs_core.planning.plan import (
    Candidate,
    CandidateStatus,
    Insight,
    Plan,
    PlanningTimes,
    Subspace,
    SubspaceState,
)
from hgs_core.robot.path import Path as RobotPath
from hgs_core.robot.robot import RobotState
from hgs_core.sensing.frame import Frame
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap

FRAME_INTERVAL_S = 0.4
ROOM_M = (8.0, 5.0, 2.6)
FURNITURE = ((1.0, 1.0, (0.8, 0.3, 0.2)), (5.5, 3.2, (0.2, 0.4, 0.8)), (3.5, 2.1, (0.3, 0.6, 0.3)))


def runner(name: str) -> str:
    """The dotted name of one of the runners below."""
    assert callable(globals()[name])
    return f"{__name__}:{name}"


def run_long(request: Any, *, observer: Any, commands: Any) -> None:
    """Runs until it is stopped, as far as a test is concerned."""
    _drive(request, observer, commands, frames=3000)


def run_slowly(request: Any, *, observer: Any, commands: Any) -> None:
    """At the pace of a real mission."""
    _drive(request, observer, commands, frames=600, frame_s=0.15)


def run_short(request: Any, *, observer: Any, commands: Any) -> None:
    """Ends by itself within a second."""
    _drive(request, observer, commands, frames=20)


def run_failing(request: Any, *, observer: Any, commands: Any) -> None:
    """Raises an error of the project after a few frames."""
    _drive(request, observer, commands, frames=20, raise_at=5)


def run_vanishing(request: Any, *, observer: Any, commands: Any) -> None:
    """Its process ends without a word."""
    _drive(request, observer, commands, frames=20, exit_at=5)


def run_deaf(request: Any, *, observer: Any, commands: Any) -> None:
    """Never reads a command."""
    _drive(request, observer, commands, frames=3000, deaf=True)


def _drive(
    request: Any,
    observer: Any,
    commands: Any,
    *,
    frames: int,
    frame_s: float = 0.02,
    raise_at: int = -1,
    exit_at: int = -1,
    deaf: bool = False,
) -> None:
    """Along a circle through one furnished room, obeying commands like the real loop. Every tenth frame is
    saved, and a mission that was begun before goes on from there."""
    saved = Path(f"{request.out}.partial") / "saved.json"
    frame = json.loads(saved.read_text()) if request.resume and saved.is_file() else 0
    saved.parent.mkdir(parents=True, exist_ok=True)
    observer = EventLog(saved.with_name("events.jsonl"), observer)
    if request.resume and saved.is_file():
        observer.go_on_from(frame * FRAME_INTERVAL_S)
        observer.on_event(Resumed(time_s=frame * FRAME_INTERVAL_S, reason="going on from what was saved"))
    saved.write_text(json.dumps(frame))
    observer.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.PREPARING, reason="opening the fake room"))
    rng = np.random.default_rng(request.seed)
    world = _room(rng)
    gaussians = GaussianMap()
    voxels = VoxelMap(VoxelConfig())
    trajectory: list[np.ndarray] = []
    observer.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.RUNNING, reason="the first frame is in"))
    stop_reason, message = StopReason.COMPLETE, "nothing worth seeing is left"
    began = time.perf_counter()
    paused = False
    asked = _Asked(request, observer)
    while frame < frames:
        command = None if deaf else asked.newest(commands)
        time_s = frame * FRAME_INTERVAL_S
        if command is Command.STOP:
            stop_reason, message = StopReason.INTERRUPTED, "stopped by the operator"
            break
        if frame % 10 == 0 or command is Command.SUSPEND:
            saved.write_text(json.dumps(frame))
        if command is Command.SUSPEND:
            observer.on_event(PhaseChanged(time_s=time_s, phase=MissionPhase.SUSPENDED, reason="saved"))
            return
        if command is Command.PAUSE and not paused:
            paused = True
            observer.on_event(
                PhaseChanged(time_s=time_s, phase=MissionPhase.PAUSED, reason="paused by the operator")
            )
        elif command is Command.RESUME and paused:
            paused = False
            observer.on_event(
                PhaseChanged(time_s=time_s, phase=MissionPhase.RUNNING, reason="resumed by the operator")
            )
        if paused or asked.waits(frame, time_s):
            time.sleep(0.01)
            continue
        if frame == raise_at:
            raise SceneError("the fake room has no free floor")
        if frame == exit_at:
            os._exit(7)
        share = (frame + 1) / frames
        grown = round(len(world) * share) - gaussians.size
        if grown > 0:
            gaussians.append(world[gaussians.size : gaussians.size + grown], anchor_keyframe=frame)
        robot = _robot(share, frame)
        trajectory.append(np.array([robot.x_m, robot.y_m, 1.0], np.float32))
        plan = _plan(robot, share, np.random.default_rng([request.seed, frame]))
        observer.on_event(_telemetry(frame, share, robot, gaussians.size, began))
        if frame % 5 == 0:
            observer.on_event(_plan_event(plan, time_s, frame // 5 + 1))
        if frame == 3:
            observer.on_event(Notice(time_s=time_s, level="warning", message="a fake chair is in the way"))
        if observer.wants_view():
            observer.on_view(_view(gaussians, voxels, robot, plan, trajectory, frame))
        time.sleep(frame_s)
        frame += 1
    time_s = frame * FRAME_INTERVAL_S
    observer.on_event(PhaseChanged(time_s=time_s, phase=MissionPhase.EVALUATING, reason="writing results"))
    _write(request, stop_reason, frame)
    observer.on_event(MissionEnded(time_s=time_s, stop_reason=stop_reason, message=message))
    observer.on_event(PhaseChanged(time_s=time_s, phase=MissionPhase.ENDED, reason=message))


class _Asked:
    """What the operator asks of the fake mission: as the real loop, it tells what it has taken."""

    def __init__(self, request: Any, observer: Any) -> None:
        self._observer = observer
        self._approves = False
        self._decided = 0
        self._waiting = False
        text = request.overrides.get("directives")
        if text is not None:
            self._take(Directives.model_validate_json(text), 0.0)

    def newest(self, commands: Any) -> Command | None:
        """Polls until nothing is left; directives and decisions are taken at once."""
        newest = None
        while (order := commands.poll()) is not None:
            if isinstance(order, Direct):
                self._take(order.directives, 0.0)
            elif isinstance(order, Decide):
                state = ApprovalState.APPROVED if order.approved else ApprovalState.REJECTED
                self._tell(state, order.plan_sequence, 0.0)
                self._decided, self._waiting = order.plan_sequence, False
            else:
                newest = order
        return newest

    def waits(self, frame: int, time_s: float) -> bool:
        """Whether the newest plan waits for the operator's word."""
        sequence = (frame - 1) // 5 + 1
        if not self._approves or frame == 0 or frame % 5 != 1 or self._decided >= sequence:
            return False
        if not self._waiting:
            self._waiting = True
            self._tell(ApprovalState.WAITING, sequence, time_s)
            reason = f"waits for the operator to approve plan {sequence}"
            self._observer.on_event(
                PhaseChanged(time_s=time_s, phase=MissionPhase.AWAITING_APPROVAL, reason=reason)
            )
        return True

    def _take(self, directives: Directives, time_s: float) -> None:
        self._approves = directives.approve_views
        told = directives.model_dump(mode="json")
        self._observer.on_event(DirectivesTaken(time_s=time_s, directives=told))

    def _tell(self, state: ApprovalState, sequence: int, time_s: float) -> None:
        self._observer.on_event(
            ApprovalChanged(
                time_s=time_s,
                state=state,
                plan_sequence=sequence,
                view={"x_m": 1.0, "y_m": 2.0, "yaw_rad": 0.5},
                reason="a test",
            )
        )


def _room(rng: np.random.Generator) -> np.ndarray:
    """Gaussians on a floor, four walls, a ceiling and some boxes, in the order they would be seen."""
    width, depth, height = ROOM_M
    spacing = 0.09
    parts = []

    def sheet(corner: tuple, u: tuple, v: tuple, colour: tuple) -> None:
        lengths = [float(np.linalg.norm(axis)) for axis in (u, v)]
        grid = np.stack(
            np.meshgrid(
                *[(np.arange(int(length / spacing)) + 0.5) * spacing / length for length in lengths],
                indexing="ij",
            ),
            axis=-1,
        ).reshape(-1, 2)
        points = np.array(corner) + grid[:, :1] * np.array(u) + grid[:, 1:] * np.array(v)
        checks = ((points / 0.5).astype(int).sum(axis=1) % 2) * 0.12
        tints = np.clip(np.array(colour) + checks[:, None] + rng.normal(0, 0.02, points.shape), 0, 1)
        parts.append(np.concatenate([points, tints], axis=1))

    sheet((0, 0, 0), (width, 0, 0), (0, depth, 0), (0.55, 0.42, 0.3))
    sheet((0, 0, 0), (width, 0, 0), (0, 0, height), (0.7, 0.72, 0.75))
    sheet((0, depth, 0), (width, 0, 0), (0, 0, height), (0.45, 0.55, 0.65))
    sheet((0, 0, 0), (0, depth, 0), (0, 0, height), (0.75, 0.68, 0.55))
    sheet((width, 0, 0), (0, depth, 0), (0, 0, height), (0.6, 0.7, 0.6))
    sheet((0, 0, height), (width, 0, 0), (0, depth, 0), (0.85, 0.85, 0.85))
    for x, y, colour in (
        (1.0, 1.0, (0.8, 0.3, 0.2)),
        (5.5, 3.2, (0.2, 0.4, 0.8)),
        (3.5, 2.1, (0.3, 0.6, 0.3)),
    ):
        sheet((x, y, 0.8), (1.2, 0, 0), (0, 0.8, 0), colour)
        sheet((x, y, 0), (1.2, 0, 0), (0, 0, 0.8), colour)
        sheet((x, y, 0), (0, 0.8, 0), (0, 0, 0.8), colour)
    rows = np.concatenate(parts)
    rows = rows[np.argsort(rows[:, 0] + rng.normal(0, 0.4, len(rows)))]
    parameters = np.empty((len(rows), 8), np.float32)
    parameters[:, :6] = rows
    parameters[:, 6] = np.log(0.05)
    parameters[:, 7] = 3.0
    return parameters


def _robot(share: float, frame: int) -> RobotState:
    angle = 2 * np.pi * share
    return RobotState(
        x_m=4.0 + 2.6 * float(np.cos(angle)),
        y_m=2.5 + 1.6 * float(np.sin(angle)),
        yaw_rad=float(angle + np.pi / 2),
        timestamp_s=frame * FRAME_INTERVAL_S,
        path_length_m=float(angle * 2.1),
        collisions=0,
    )


def _plan(robot: RobotState, share: float, rng: np.random.Generator) -> Plan:
    candidates = []
    for k in range(12):
        total = float(rng.uniform(10.0, 100.0) * (1.2 - share))
        status = CandidateStatus.SELECTED if k < 4 else list(CandidateStatus)[k % 4]
        candidates.append(
            Candidate(
                x_m=float(rng.uniform(0.5, 7.5)),
                y_m=float(rng.uniform(0.5, 4.5)),
                z_m=1.0,
                yaw_rad=float(rng.uniform(-np.pi, np.pi)),
                coverage_gain=total * 0.7,
                quality_gain=total * 2.0,
                total_gain=total,
                status=status,
                why="" if status is CandidateStatus.SELECTED else f"a made-up reason for {status}",
            )
        )
    subspaces = tuple(
        Subspace(
            lower_m=(2.0 * i, 2.5 * j, 0.0),
            upper_m=(2.0 * i + 2.0, 2.5 * j + 2.5, 2.6),
            state=_subspace_state(share, i),
            missing_volume_m3=max(0.0, 2.0 - 4 * share),
        )
        for i in range(4)
        for j in range(2)
    )
    points = np.array([(c.x_m, c.y_m) for c in candidates[:4]])
    here = np.array([[robot.x_m, robot.y_m]])
    on_floor = np.concatenate([here, points])
    local = np.concatenate([on_floor, np.full((5, 1), 0.0)], axis=1)
    tour = np.array([[robot.x_m, robot.y_m, 0], [7.0, 4.0, 0], [7.0, 1.0, 0], [1.0, 4.0, 0]])
    return Plan(
        path=RobotPath(positions_m=on_floor, yaws_rad=np.full(5, np.nan)),
        candidates=tuple(candidates),
        subspaces=subspaces,
        global_tour_m=tour,
        local_path_m=local,
        horizon=Box(lower_m=np.zeros(3), upper_m=np.array(ROOM_M)),
        observed_share=share,
        reason=f"4 of 12 views are worth the way; {100 * share:.0f} % of the surroundings is known",
        times=PlanningTimes(viewpoint_evaluation_s=0.02, local_s=0.01, global_s=0.005),
    )


def _subspace_state(share: float, column: int) -> SubspaceState:
    if share > (column + 1) / 4:
        return SubspaceState.RECONSTRUCTED
    return SubspaceState.RECONSTRUCTING if share > column / 4 else SubspaceState.UNRECONSTRUCTED


def _plan_event(plan: Plan, time_s: float, sequence: int) -> PlanMade:
    return PlanMade(
        time_s=time_s,
        plan_sequence=sequence,
        reason=plan.reason,
        n_candidates=len(plan.candidates),
        n_selected=4,
        n_reconstructing=2,
        path_length_m=plan.path.length_m,
        observed_share=plan.observed_share,
        planning_s=plan.times.total_s,
        viewpoint_evaluation_s=plan.times.viewpoint_evaluation_s,
        local_s=plan.times.local_s,
        global_s=plan.times.global_s,
        candidates=tuple(
            {
                "x_m": c.x_m,
                "y_m": c.y_m,
                "yaw_rad": c.yaw_rad,
                "coverage": c.coverage_gain,
                "quality": c.quality_gain,
                "total": c.total_gain,
                "status": str(c.status),
                **({"why": c.why} if c.why else {}),
            }
            for c in plan.candidates
        ),
    )


def _telemetry(frame: int, share: float, robot: RobotState, n_gaussians: int, began: float) -> Telemetry:
    return Telemetry(
        time_s=frame * FRAME_INTERVAL_S,
        frame=frame,
        x_m=robot.x_m,
        y_m=robot.y_m,
        yaw_rad=robot.yaw_rad,
        path_length_m=robot.path_length_m,
        collisions=0,
        n_gaussians=n_gaussians,
        n_keyframes=frame // 3,
        observed_volume_m3=100.0 * share,
        missing_volume_m3=40.0 * (1.0 - share),
        psnr_current_db=float("nan") if frame == 0 else 18.0 + 8.0 * share,
        mapping_s=0.018,
        iterations=10 * (frame + 1),
        frames_dropped=0,
        frames_thinned=0,
        wall_s=time.perf_counter() - began,
    )


def _view(
    gaussians: GaussianMap,
    voxels: VoxelMap,
    robot: RobotState,
    plan: Plan,
    trajectory: list[np.ndarray],
    frame: int,
) -> MissionView:
    camera = CameraIntrinsics.centred(320, 180, 160.0)
    rows, columns = np.mgrid[0:180, 0:320]
    rgb = np.stack([columns * 255 // 320, rows * 255 // 180, (columns + 7 * frame) % 256], -1).astype(
        np.uint8
    )
    depth = (1.0 + 3.0 * columns / 320).astype(np.float32)
    depth[:20, :20], depth[:20, -20:] = 0.0, np.inf
    return MissionView(
        time_s=robot.timestamp_s,
        snapshot=MapSnapshot(
            gaussians=gaussians, voxels=voxels, version=frame, timestamp_s=robot.timestamp_s
        ),
        robot=robot,
        plan=plan,
        insight=_insight(plan),
        directives=Directives(),
        frame=Frame(
            rgb=rgb,
            depth_m=depth,
            intrinsics=camera,
            T_world_camera=level_camera_pose(robot.x_m, robot.y_m, 1.0, robot.yaw_rad),
            timestamp_s=robot.timestamp_s,
            sequence=frame,
        ),
        trajectory_m=np.stack(trajectory),
        rendered_rgb=np.ascontiguousarray(rgb[::2, ::2]),
        rendered_depth_m=np.ascontiguousarray(depth[::2, ::2]),
    )


def _insight(plan: Plan) -> Insight:
    """A gain that is greatest ahead, and a roadmap along the way."""
    ahead = np.cos(np.linspace(-np.pi, np.pi, 60)) + 1.0
    way = np.stack([plan.path.positions_m[:-1], plan.path.positions_m[1:]], axis=1)
    return Insight(
        view_m=np.array([*plan.path.positions_m[1], 1.0]),
        panorama=GainPanorama(
            coverage=np.tile(ahead, (16, 1)).astype(np.float32),
            quality=np.tile(ahead[::-1], (6, 1)).astype(np.float32),
            tan_low=-0.5,
            tan_high=0.5,
        ),
        roadmap_m=way,
    )


def _write(request: Any, stop_reason: StopReason, frames: int) -> None:
    out = Path(request.out)
    shutil.rmtree(f"{out}.partial")
    out.mkdir(parents=True)
    report = {
        "scene": request.scene,
        "seed": request.seed,
        "clock": request.clock,
        **({"extends": str(request.extends)} if request.extends else {}),
        "stop_reason": str(stop_reason),
        "frames": frames,
    }
    (out / "report.json").write_text(json.dumps(report), encoding="utf-8")
    (out / "trajectory.txt").write_text("# timestamp tx ty tz qx qy qz qw\n", encoding="utf-8")
