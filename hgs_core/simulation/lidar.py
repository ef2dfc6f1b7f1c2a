"""`SimulatedLidar`: scans of a mesh by a spinning lidar."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.geometry.se3 import SE3
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.lidar import LidarConfig
from hgs_core.sensing.point_scan import PointScan


class SimulatedLidar:
    """Casts all rays of a turn from one place at one moment; ranges have normal noise."""

    def __init__(self, caster: RayCaster, config: LidarConfig, rng: np.random.Generator) -> None:
        self._caster = caster
        self._config = config
        self._rng = rng
        self._directions = _directions(config)
        self._sequence = 0

    def scan(self, T_world_lidar: SE3, timestamp_s: float) -> PointScan:
        """A turn at that pose (x forward, y left, z up), in the order of azimuth, then of rings upwards.

        One number is drawn per ray whatever it meets, so later draws do not depend on the scene.
        """
        rays = self._directions @ T_world_lidar.rotation.T
        ranges = self._caster.cast(np.broadcast_to(T_world_lidar.translation, rays.shape), rays).astype(
            np.float64
        )
        measured = (ranges >= self._config.nearest_m) & (ranges <= self._config.range_m)
        ranges = ranges + self._config.noise_m * self._rng.standard_normal(len(ranges))
        points = self._directions[measured] * ranges[measured][:, None]
        scan = PointScan(
            points_m=points.astype(np.float32),
            T_world_lidar=T_world_lidar,
            timestamp_s=timestamp_s,
            sequence=self._sequence,
        )
        self._sequence += 1
        return scan

    def state(self) -> dict[str, Any]:
        """Everything that later scans depend on, besides mesh and settings."""
        return {"sequence": self._sequence, "rng": self._rng.bit_generator.state}

    def restore(self, state: dict[str, Any]) -> None:
        self._sequence = state["sequence"]
        self._rng.bit_generator.state = state["rng"]


def level_lidar_pose(x_m: float, y_m: float, z_m: float, yaw_rad: float) -> SE3:
    """`T_world_lidar` of a level lidar that heads `yaw_rad` (0 = world +x, counter-clockwise)."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return SE3(rotation=rotation, translation=np.array([x_m, y_m, z_m], dtype=float))


def _directions(config: LidarConfig) -> Float[ndarray, "n_rays 3"]:
    """Unit vectors in the lidar's frame."""
    n_columns = max(1, round(360.0 / config.azimuth_step_deg))
    azimuth = np.arange(n_columns) * (2.0 * np.pi / n_columns)
    elevation = np.radians(np.linspace(config.lowest_deg, config.highest_deg, config.n_rings))
    azimuth, elevation = (grid.ravel() for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)
