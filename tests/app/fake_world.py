"""A furnished room that a fake mission sees more and more of: maps, plans and views without a simulator."""

from __future__ import annotations

import time

import numpy as np

from hgs_core.gain.viewpoint import GainPanorama
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.mission.events import (
    MissionView,
    Telemetry,
)
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


def room(rng: np.random.Generator) -> np.ndarray:
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


def robot_at(share: float, frame: int) -> RobotState:
    angle = 2 * np.pi * share
    return RobotState(
        x_m=4.0 + 2.6 * float(np.cos(angle)),
        y_m=2.5 + 1.6 * float(np.sin(angle)),
        yaw_rad=float(angle + np.pi / 2),
        timestamp_s=frame * FRAME_INTERVAL_S,
        path_length_m=float(angle * 2.1),
        collisions=0,
    )


def plan_from(robot: RobotState, share: float, rng: np.random.Generator) -> Plan:
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


def telemetry_of(frame: int, share: float, robot: RobotState, n_gaussians: int, began: float) -> Telemetry:
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


def view_of(
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


def furnished_room(frame: int = 7) -> MissionView:
    """What is shown of the room when all of it has been seen."""
    rng = np.random.default_rng(0)
    gaussians = GaussianMap()
    gaussians.append(room(rng), anchor_keyframe=0)
    robot = robot_at(0.3, frame)
    plan = plan_from(robot, 0.3, rng)
    trajectory = [np.array([0.1 * k, 0.0, 1.0], np.float32) for k in range(10)]
    return view_of(gaussians, VoxelMap(VoxelConfig()), robot, plan, trajectory, frame)
