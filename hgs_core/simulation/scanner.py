"""`SimulatedScanner`: planar scans of a mesh around the simulated robot."""

from __future__ import annotations

from typing import Any

import numpy as np

from hgs_core.robot.robot import Robot
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.depth_camera import with_uniform_noise
from hgs_core.sensing.frame import Scan
from hgs_core.sensing.scanner import ScannerConfig


class SimulatedScanner:
    """Implements `Scanner` by ray casting: one instantaneous turn, ranges with uniform noise."""

    def __init__(
        self, caster: RayCaster, robot: Robot, config: ScannerConfig, rng: np.random.Generator
    ) -> None:
        self._caster = caster
        self._robot = robot
        self._config = config
        self._rng = rng

    def scan(self) -> Scan:
        robot = self._robot.state
        origin = np.array([robot.x_m, robot.y_m, self._config.mount_height_m])
        bearings = robot.yaw_rad + np.arange(self._config.n_rays) * (2 * np.pi / self._config.n_rays)
        directions = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=-1)
        ranges = self._caster.cast(np.broadcast_to(origin, directions.shape), directions)
        ranges = np.where(ranges <= self._config.range_m, ranges, np.float32(np.inf))
        return Scan(
            origin_m=origin,
            bearings_rad=bearings,
            ranges_m=with_uniform_noise(ranges, self._config.noise_m, self._rng),
            timestamp_s=robot.timestamp_s,
            robot_id=robot.robot_id,
        )

    def state(self) -> dict[str, Any]:
        """Everything that later scans depend on, besides mesh, robot and settings."""
        return {"rng": self._rng.bit_generator.state}

    def restore(self, state: dict[str, Any]) -> None:
        self._rng.bit_generator.state = state["rng"]
