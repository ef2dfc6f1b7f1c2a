"""`SimulatedCamera`: RGB-D frames of a mesh from where the simulated robot stands."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.robot.robot import Robot
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.depth_camera import DepthCameraConfig, with_uniform_noise
from hgs_core.sensing.frame import Frame
from hgs_core.simulation.registry import SensorMethod


class SimulatedCamera:
    """Implements `Sensor` by ray casting; poses are exact, depth carries uniform noise."""

    def __init__(
        self, caster: RayCaster, robot: Robot, config: DepthCameraConfig, rng: np.random.Generator
    ) -> None:
        self._caster = caster
        self._robot = robot
        self._config = config
        self._rng = rng
        self._intrinsics = config.intrinsics()
        self._sequence = 0

    def capture(self) -> Frame:
        robot = self._robot.state
        pose = level_camera_pose(robot.x_m, robot.y_m, self._config.mount_height_m, robot.yaw_rad)
        rgb, depth = self._caster.render(self._intrinsics, pose, self._config.range_m)
        frame = Frame(
            rgb=rgb,
            depth_m=with_uniform_noise(self.returned(depth, pose), self._config.depth_noise_m, self._rng),
            intrinsics=self._intrinsics,
            T_world_camera=pose,
            timestamp_s=robot.timestamp_s,
            sequence=self._sequence,
            robot_id=robot.robot_id,
        )
        self._sequence += 1
        return frame

    def returned(
        self, depth_m: Float32[ndarray, "height width"], T_world_camera: SE3
    ) -> Float32[ndarray, "height width"]:
        """What the sensor gets back of the true depths, before noise: here all of it."""
        return depth_m

    def state(self) -> dict[str, Any]:
        """Everything that later frames depend on, besides mesh, robot and settings."""
        return {"sequence": self._sequence, "rng": self._rng.bit_generator.state}

    def restore(self, state: dict[str, Any]) -> None:
        self._sequence = state["sequence"]
        self._rng.bit_generator.state = state["rng"]


METHOD = SensorMethod(config=DepthCameraConfig, build=SimulatedCamera)
