"""A world with no simulator behind it: true occupancy, ideal rays, a point robot, a counting gain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from hgs_core.gain.viewpoint import ViewGains
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.robot.robot import RobotState
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

SIZE_M = 0.1
RANGE_M = 4.0
CAMERA = CameraIntrinsics.centred(80, 46, 40.0)
CAMERA_HEIGHT_M = 1.0
STEP_M = 0.05


@dataclass
class ClosedWorld:
    """True occupancy over `[0, nx * 0.1) x ...`; its border is solid."""

    solid: np.ndarray
    wall_m: tuple[float, float] = (np.inf, np.inf)
    """x of the wall between the front rooms, y of the wall before the back room."""

    @property
    def region(self) -> Box:
        return Box(lower_m=np.zeros(3), upper_m=np.array(self.solid.shape) * SIZE_M)

    def is_solid(self, points_m: np.ndarray) -> np.ndarray:
        index = np.floor(points_m / SIZE_M).astype(int)
        inside = np.all((index >= 0) & (index < self.solid.shape), axis=-1)
        index = np.clip(index, 0, np.array(self.solid.shape) - 1)
        return ~inside | self.solid[index[..., 0], index[..., 1], index[..., 2]]

    def ranges_m(self, origin_m: np.ndarray, directions: np.ndarray, reach_m: float) -> np.ndarray:
        """Length along each direction to the first solid point, +inf beyond `reach_m`."""
        steps = np.arange(STEP_M, reach_m, STEP_M)
        hit = self.is_solid(origin_m + steps[:, None, None] * directions[None])
        return np.where(hit.any(axis=0), steps[hit.argmax(axis=0)], np.inf)

    def frame(self, x_m: float, y_m: float, yaw_rad: float, time_s: float, sequence: int) -> Frame:
        pose = level_camera_pose(x_m, y_m, CAMERA_HEIGHT_M, yaw_rad)
        rays = CAMERA.rays().reshape(-1, 3) @ pose.rotation.T
        depth = self.ranges_m(pose.translation, rays, RANGE_M)
        return Frame(
            rgb=np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8),
            depth_m=depth.reshape(CAMERA.height, CAMERA.width).astype(np.float32),
            intrinsics=CAMERA,
            T_world_camera=pose,
            timestamp_s=time_s,
            sequence=sequence,
        )

    def scan(self, x_m: float, y_m: float, time_s: float) -> Scan:
        bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
        directions = np.column_stack([np.cos(bearings), np.sin(bearings), np.zeros(360)])
        origin = np.array([x_m, y_m, 0.15])
        ranges = self.ranges_m(origin, directions, RANGE_M).astype(np.float32)
        return Scan(origin_m=origin, bearings_rad=bearings, ranges_m=ranges, timestamp_s=time_s)

    def distance_to_solid_m(self, x_m: float, y_m: float, top_m: float = 1.1) -> float:
        """From a point of the plane to the nearest solid voxel box below `top_m` (above the floor)."""
        body = self.solid[:, :, 1 : round(top_m / SIZE_M)].any(axis=2)
        ij = np.argwhere(body)
        away = np.maximum(np.abs(np.array([x_m, y_m]) / SIZE_M - (ij + 0.5)) - 0.5, 0.0)
        return float(np.hypot(away[:, 0], away[:, 1]).min()) * SIZE_M


def three_rooms() -> ClosedWorld:
    """Two rooms side by side and one behind both, 0.9 m doors, furniture; 7 x 6 x 2.2 m."""
    solid = np.zeros((70, 60, 22), dtype=bool)
    solid[:, :, 0] = solid[:, :, -1] = True  # floor (the layer below 0.1 m) and ceiling
    solid[[0, -1]] = solid[:, [0, -1]] = True
    solid[35, :35] = True
    solid[35, 12:21, 1:19] = False  # door between A (left) and B (right)
    solid[:, 35] = True
    solid[50:59, 35, 1:19] = False  # door between B and C (behind both)
    solid[8:15, 23:29, 7] = True  # a table top in A ...
    solid[[8, 14], 23, 1:8] = solid[[8, 14], 28, 1:8] = True  # ... on legs
    solid[55:69, 1:5, 1:16] = True  # a shelf in B
    solid[20:24, 45:52, 1:12] = True  # a cupboard in the middle of C
    return ClosedWorld(solid, wall_m=(3.5, 3.5))


class CountingGain:
    """Gain = volume of missing voxels in range and in the field of view, nothing occupied before them."""

    def __init__(self, scale: float = 1.0) -> None:
        self.scale = scale
        self.calls = 0
        self.places = 0

    def evaluate(
        self,
        snapshot: MapSnapshot,
        positions_m: np.ndarray,
        *,
        observed_share: float,
        coverage_only: bool = False,
    ) -> ViewGains:
        self.calls += 1
        self.places += len(positions_m)
        voxels = snapshot.voxels
        missing = voxels.centres_m(np.argwhere(voxels.missing()))
        stride = max(1, len(missing) // 300)
        missing, weight = missing[::stride], stride * SIZE_M**3 * self.scale
        yaws = np.linspace(-np.pi, np.pi, 48, endpoint=False)
        gains = np.zeros((len(positions_m), len(yaws)))
        for i, position in enumerate(positions_m):
            offset = missing - position
            flat = np.hypot(offset[:, 0], offset[:, 1])
            near = (flat < RANGE_M) & (np.abs(offset[:, 2]) < flat * np.tan(CAMERA.vertical_fov_rad / 2))
            seen = offset[near][self._in_sight(voxels, position, missing[near])]
            bearing = np.arctan2(seen[:, 1], seen[:, 0])
            turned = np.abs((bearing[:, None] - yaws + np.pi) % (2 * np.pi) - np.pi)
            gains[i] = weight * np.count_nonzero(turned < CAMERA.horizontal_fov_rad / 2, axis=0)
        best = gains.argmax(axis=1)
        rows = np.arange(len(positions_m))
        return ViewGains(
            yaws_rad=yaws,
            coverage_by_yaw=gains,
            quality_by_yaw=np.zeros_like(gains),
            total_by_yaw=gains,
            coverage=gains[rows, best],
            quality=np.zeros(len(positions_m)),
            total=gains[rows, best],
            best_yaw_rad=yaws[best],
        )

    @staticmethod
    def _in_sight(voxels: VoxelMap, position: np.ndarray, targets: np.ndarray) -> np.ndarray:
        if not len(targets):
            return np.zeros(0, dtype=bool)
        shares = np.linspace(0.01, 0.98, 55)
        between = position + shares[:, None, None] * (targets - position)[None]
        index, inside = voxels.index_of(between.reshape(-1, 3))
        index = np.clip(index, 0, np.array(voxels.states.shape) - 1)
        states = voxels.states[index[:, 0], index[:, 1], index[:, 2]]
        blocked = inside & (states == VoxelState.OCCUPIED)
        return ~blocked.reshape(len(shares), -1).any(axis=0)


@dataclass
class PointRobot:
    """Turns in place at 60 deg/s, drives at 1 m/s, observes every 0.4 s."""

    world: ClosedWorld
    voxels: VoxelMap
    x_m: float
    y_m: float
    yaw_rad: float
    time_s: float = 0.0
    length_m: float = 0.0
    trail: list[tuple[float, float, float]] = field(default_factory=list)

    @property
    def state(self) -> RobotState:
        return RobotState(
            x_m=self.x_m,
            y_m=self.y_m,
            yaw_rad=self.yaw_rad,
            timestamp_s=self.time_s,
            path_length_m=self.length_m,
            collisions=0,
        )

    @property
    def snapshot(self) -> MapSnapshot:
        return MapSnapshot(
            gaussians=GaussianMap(), voxels=self.voxels, version=self.voxels.version, timestamp_s=self.time_s
        )

    def observe(self) -> None:
        self.trail.append((self.x_m, self.y_m, self.yaw_rad))
        self.voxels.integrate_scan(self.world.scan(self.x_m, self.y_m, self.time_s), range_m=RANGE_M)
        frame = self.world.frame(self.x_m, self.y_m, self.yaw_rad, self.time_s, len(self.trail))
        self.voxels.integrate_frame(frame, range_m=RANGE_M)

    def moves_to(self, x_m: float, y_m: float, yaw_rad: float) -> Iterator[bool]:
        """Turn to the way, drive, take up the yaw (unless NaN), a frame a step; true on arrival."""
        if np.hypot(x_m - self.x_m, y_m - self.y_m) > 1e-6:
            heading = float(np.arctan2(y_m - self.y_m, x_m - self.x_m))
            while not self._turn_to(heading):
                yield False
            while not self._drive_to(x_m, y_m):
                yield False
        if np.isfinite(yaw_rad):
            while not self._turn_to(yaw_rad):
                yield False
        yield True

    def _turn_to(self, yaw_rad: float) -> bool:
        difference = (yaw_rad - self.yaw_rad + np.pi) % (2 * np.pi) - np.pi
        step = float(np.clip(difference, -np.radians(24.0), np.radians(24.0)))
        self.yaw_rad += step
        self.time_s += abs(step) / np.radians(60.0)
        return bool(abs(difference) <= np.radians(24.0))

    def _drive_to(self, x_m: float, y_m: float) -> bool:
        away = float(np.hypot(x_m - self.x_m, y_m - self.y_m))
        step = min(away, 0.4)
        if away > 0:
            self.x_m += (x_m - self.x_m) * step / away
            self.y_m += (y_m - self.y_m) * step / away
        self.time_s += step
        self.length_m += step
        return away <= 0.4


def new_voxels(world: ClosedWorld) -> VoxelMap:
    return VoxelMap(VoxelConfig(pixel_stride=1), region=world.region)
