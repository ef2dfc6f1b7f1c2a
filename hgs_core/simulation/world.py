"""`SimulatedWorld`: a scene with a robot in it that carries a camera and a scanner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hgs_core.errors import RobotError
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.robot import RobotConfig
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.registry import SimulatedSensor, build_sensor
from hgs_core.simulation.robot import SimulatedRobot
from hgs_core.simulation.scanner import SimulatedScanner
from hgs_core.simulation.vehicle import SimulatedVehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedWorld:
    """Everything on the far side of the seams `Robot`, `Sensor` and `Scanner`."""

    scene: Scene
    robot: SimulatedRobot | SimulatedVehicle
    camera: SimulatedSensor
    scanner: SimulatedScanner

    @staticmethod
    def of(
        scene: Scene,
        *,
        robot: RobotConfig,
        camera: DepthCameraConfig,
        scanner: ScannerConfig,
        seeds: np.random.SeedSequence,
    ) -> SimulatedWorld:
        """The robot at the scene's start; camera and scanner noise draw from two children of `seeds`."""
        camera_seed, scanner_seed = seeds.spawn(2)
        vehicle = _simulated(robot, scene)
        return SimulatedWorld(
            scene=scene,
            robot=vehicle,
            camera=build_sensor(scene.caster, vehicle, camera, np.random.default_rng(camera_seed)),
            scanner=SimulatedScanner(scene.caster, vehicle, scanner, np.random.default_rng(scanner_seed)),
        )

    def state(self) -> dict[str, Any]:
        """Robot, clock and random states; the scene is opened again from its name."""
        return {
            "robot": self.robot.snapshot(),
            "camera": self.camera.state(),
            "scanner": self.scanner.state(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        self.robot.restore(state["robot"])
        self.camera.restore(state["camera"])
        self.scanner.restore(state["scanner"])


def _simulated(robot: RobotConfig, scene: Scene) -> SimulatedRobot | SimulatedVehicle:
    obstacles = BodyObstacles(scene.mesh, robot.height_m)
    if isinstance(robot, AckermannConfig | HolonomicConfig):
        return SimulatedVehicle(robot, obstacles, scene.start)
    if isinstance(robot, DifferentialConfig):
        return SimulatedRobot(robot, obstacles, scene.start)
    raise RobotError(f"no simulated robot drives as {robot.drive!r}")
