"""Maps as a mission leaves them behind, kept as plain arrays: what is needed to plan again, and no world."""

from __future__ import annotations

import pickle
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.information import accumulate_information
from hgs_core.gaussians.place_order import place_order
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelMap
from tests.planning.closed_world import CAMERA, CAMERA_HEIGHT_M, RANGE_M, ClosedWorld, PointRobot

Recording = dict[str, Any]

PLANNED_FOR = CameraIntrinsics.centred(300, 170, 150.0)
"""The camera whose views the Gaussians have learnt from; `CAMERA` is too coarse to tell them apart."""
FLOOR_BELOW_M = 0.1
"""The closed worlds' floor is a layer of voxels with its top here: its Gaussians belong at 0."""


def record(robot: PointRobot) -> Recording:
    """What the robot's maps hold now, and Gaussians on every surface that it saw on its way."""
    return {
        "voxels": robot.voxels.state(),
        "gaussians": gaussians_seen(robot.world, robot.trail).state(),
        "robot": asdict(robot.state),
        "lower_m": robot.world.region.lower_m.tolist(),
        "upper_m": robot.world.region.upper_m.tolist(),
    }


def gaussians_seen(world: ClosedWorld, trail: list[tuple[float, float, float]]) -> GaussianMap:
    """One Gaussian where the first ray met each 5 cm of surface, with the information of all frames."""
    poses = [level_camera_pose(x_m, y_m, CAMERA_HEIGHT_M, yaw) for x_m, y_m, yaw in trail]
    points = []
    for x_m, y_m, yaw in trail:
        frame = world.frame(x_m, y_m, yaw, 0.0, 0)
        hit = np.isfinite(frame.depth_m)
        rays = CAMERA.rays()[hit] * frame.depth_m[hit][:, None]
        points.append(frame.T_world_camera.apply(rays))
    centres = np.concatenate(points)
    _, first = np.unique(np.round(centres / 0.05), axis=0, return_index=True)
    rows = np.zeros((len(first), 8), np.float32)
    rows[:, :3] = centres[first]
    rows[rows[:, 2] <= FLOOR_BELOW_M, 2] = 0.0
    rows[:, 3:6] = 0.5
    rows[:, 6] = np.log(0.03)
    rows[:, 7] = 2.0
    gaussians = GaussianMap()
    gaussians.append(rows[place_order(rows[:, :3])], anchor_keyframe=0)
    for pose in poses:
        accumulate_information(gaussians, PLANNED_FOR, pose, far_m=RANGE_M)
    return gaussians


def play_back(recording: Recording) -> tuple[MapSnapshot, RobotState]:
    voxels = VoxelMap.restore(recording["voxels"])
    gaussians = GaussianMap.restore(recording["gaussians"])
    robot = RobotState(**recording["robot"])
    version = voxels.version + gaussians.version
    snapshot = MapSnapshot(gaussians=gaussians, voxels=voxels, version=version, timestamp_s=robot.timestamp_s)
    return snapshot, robot


def save(recordings: list[Recording], path: Path) -> None:
    path.write_bytes(pickle.dumps(recordings))


def load(path: Path) -> list[Recording]:
    recordings: list[Recording] = pickle.loads(path.read_bytes())
    return recordings
