"""Lidar odometry by KISS-ICP (Vizzo et al. 2023): each scan is aligned to a map of the scans before it."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Final, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from hgs_core.errors import ConfigError
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.localiser import LocalisationConfig, Located, Lost
from hgs_core.localisation.motion import MotionLimits, StampedPose
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame

_FEWEST_POINTS: Final = 100
_LEVEL_CAMERA: Final = level_camera_pose(0, 0, 0, 0)


class LidarOdometryConfig(LocalisationConfig):
    """The camera rides on the lidar: its pose is the lidar's, and the mounting.

    Scans are taken as of one moment: motion during a turn is not undone. Needs `pip install 'hgs[lidar]'`.
    """

    method: Literal["lidar-odometry"] = "lidar-odometry"
    voxel_size_m: float = Field(0.25, gt=0)
    """Of the map that scans are aligned to [m]: a quarter of a metre indoors, one outdoors."""
    max_points_per_voxel: int = Field(20, ge=1)
    range_m: float = Field(100.0, gt=0)
    """Farther points are not used, and the map is let go of beyond it [m]."""
    nearest_m: float = Field(0.4, ge=0)
    """Nearer points are not used: they are of the robot itself [m]."""
    initial_threshold_m: float = Field(0.5, gt=0)
    """How far apart matching points may be at first [m]; KISS-ICP adapts it to the motion it meets."""
    max_iterations: int = Field(500, ge=1)
    threads: int = Field(1, ge=1)
    """More than one are faster and give results that differ in their last digits from run to run."""
    min_fitness: float = Field(0.7, gt=0, le=1)
    """Share of the scan's points that must lie within a voxel of the map."""
    max_scan_age_s: float = Field(0.25, gt=0)
    """A frame is located from the motion of the last scans until so long after them [s]."""
    camera_xyz_m: tuple[float, float, float] = (0.0, 0.0, -0.2)
    """Where the camera sits in the lidar's frame (x forward, y left, z up) [m]."""
    camera_rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """How the camera looks from there: roll, pitch and yaw about x, y and z [degrees]; zeros look forward,
    level, and a positive pitch looks down."""
    limits: MotionLimits = MotionLimits()

    def T_lidar_camera(self) -> SE3:
        """The mounting."""
        turned = Rotation.from_euler("xyz", self.camera_rpy_deg, degrees=True).as_matrix()
        return SE3(rotation=turned, translation=np.array(self.camera_xyz_m)) @ _LEVEL_CAMERA


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """How the camera sits on the lidar, as the settings of those names say it."""

    camera_xyz_m: tuple[float, float, float]
    camera_rpy_deg: tuple[float, float, float]

    @staticmethod
    def of(T_lidar_camera: SE3) -> Mounting:
        """The inverse of `LidarOdometryConfig.T_lidar_camera`."""
        turned = Rotation.from_matrix((T_lidar_camera @ _LEVEL_CAMERA.inverse()).rotation)
        x_m, y_m, z_m = T_lidar_camera.translation.tolist()
        roll, pitch, yaw = turned.as_euler("xyz", degrees=True).tolist()
        return Mounting(camera_xyz_m=(x_m, y_m, z_m), camera_rpy_deg=(roll, pitch, yaw))


class LidarOdometry:
    """Implements `Localiser`. The first scan stands where the camera is at `start`; from there errors add up.

    A scan that does not fit is left out, and the map stays as it was. Raises `ConfigError` without kiss-icp.
    """

    def __init__(self, config: LidarOdometryConfig, start: SE3) -> None:
        self._config = config
        self._T_lidar_camera = config.T_lidar_camera()
        self._T_world_start = start @ self._T_lidar_camera.inverse()
        self._kiss = _kiss_icp(config)
        self._scans: tuple[StampedPose, ...] = ()
        """The last two that were aligned, in the world."""
        self._doubt: str | None = "no scan has come yet"

    def take_scan(self, scan: PointScan) -> None:
        self._doubt = self._aligned(scan)

    def locate(self, frame: AlignedFrame) -> Located | Lost:
        if not self._scans:
            return Lost(reason=f"frame {frame.sequence}: {self._doubt}")
        last = self._scans[-1]
        age_s = frame.timestamp_s - last.timestamp_s
        if age_s > self._config.max_scan_age_s:
            return Lost(
                reason=f"frame {frame.sequence}: the last scan that was aligned is {age_s:.2f} s older, at "
                f"most {self._config.max_scan_age_s} s is believed; {self._doubt or 'no scan came since'}"
            )
        before = self._scans[0]
        if frame.timestamp_s < before.timestamp_s:
            return Lost(
                reason=f"frame {frame.sequence} is {-age_s:.2f} s older than the scans: it comes late"
            )
        return Located(T_world_camera=self._at(frame.timestamp_s) @ self._T_lidar_camera)

    def _at(self, time_s: float) -> SE3:
        """Between the last two scans, and beyond them in steady motion."""
        before, last = self._scans[0], self._scans[-1]
        if before is last:
            return last.pose
        share = (time_s - before.timestamp_s) / (last.timestamp_s - before.timestamp_s)
        return before.pose @ SE3.exp(share * (before.pose.inverse() @ last.pose).log())

    def _aligned(self, scan: PointScan) -> str | None:
        """Align a scan and put it on the map; or why that was not done."""
        if len(scan.points_m) < _FEWEST_POINTS:
            return (
                f"scan {scan.sequence} has {len(scan.points_m)} points, at least {_FEWEST_POINTS} are needed"
            )
        if self._scans and scan.timestamp_s <= self._scans[-1].timestamp_s:
            return f"scan {scan.sequence}: its time {scan.timestamp_s:.3f} s is not after the last one's"
        kiss = self._kiss
        points = kiss.preprocessor.preprocess(scan.points_m.astype(np.float64), np.zeros(0), kiss.last_delta)
        source, map_points = kiss.voxelize(points)
        if not self._scans:
            self._accept(scan, map_points, np.eye(4), SE3.identity())
            return None
        sigma = kiss.adaptive_threshold.get_threshold()
        guess = kiss.last_pose @ kiss.last_delta
        found = kiss.registration.align_points_to_map(
            points=source,
            voxel_map=kiss.local_map,
            initial_guess=guess,
            max_correspondance_distance=3 * sigma,
            kernel=sigma,
        )
        pose = SE3(rotation=found[:3, :3], translation=found[:3, 3])
        world = self._T_world_start @ pose
        last = self._scans[-1]
        wrong = self._misfit(pose.apply(source)) or self._config.limits.violation(
            last.pose, world, scan.timestamp_s - last.timestamp_s
        )
        if wrong is not None:
            kiss.last_delta = np.eye(4)
            return f"scan {scan.sequence} was not aligned: {wrong}"
        kiss.adaptive_threshold.update_model_deviation(np.linalg.inv(guess) @ found)
        self._accept(scan, map_points, np.linalg.inv(kiss.last_pose) @ found, pose)
        return None

    def _accept(
        self, scan: PointScan, map_points: Float[ndarray, "n 3"], delta: Float[ndarray, "4 4"], pose: SE3
    ) -> None:
        kiss = self._kiss
        kiss.local_map.update(map_points, pose.as_matrix())
        kiss.last_delta, kiss.last_pose = delta, pose.as_matrix()
        stamped = StampedPose(pose=self._T_world_start @ pose, timestamp_s=scan.timestamp_s)
        self._scans = (*self._scans[-1:], stamped)

    def _misfit(self, points_m: Float[ndarray, "n 3"]) -> str | None:
        known = cKDTree(self._kiss.local_map.point_cloud())
        distance_m, _ = known.query(points_m, distance_upper_bound=self._config.voxel_size_m)
        fitness = float(np.isfinite(distance_m).mean())
        if fitness >= self._config.min_fitness:
            return None
        return f"fitness {fitness:.2f}, at least {self._config.min_fitness} is needed"


def _kiss_icp(config: LidarOdometryConfig) -> Any:
    """The parts of a KISS-ICP pipeline, with these settings."""
    if find_spec("kiss_icp") is None:
        raise ConfigError("localisation.method = 'lidar-odometry' needs kiss-icp: pip install 'hgs[lidar]'")
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    return KissICP(
        KISSConfig(
            data={"max_range": config.range_m, "min_range": config.nearest_m, "deskew": False},
            mapping={
                "voxel_size": config.voxel_size_m,
                "max_points_per_voxel": config.max_points_per_voxel,
            },
            registration={"max_num_iterations": config.max_iterations, "max_num_threads": config.threads},
            adaptive_threshold={"initial_threshold": config.initial_threshold_m, "min_motion_th": 0.01},
        )
    )
