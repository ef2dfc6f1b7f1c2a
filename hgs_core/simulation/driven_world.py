"""`DrivenWorld`: a scene with a driven robot in it, whose sensors may be told wrong poses and have holes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.robot import RobotConfig
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.frame import Frame, Scan
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.depth_holes import DepthHoles
from hgs_core.simulation.driven_robot import DrivenRobot
from hgs_core.simulation.pose_drift import PoseDrift
from hgs_core.simulation.registry import SimulatedSensor, build_sensor
from hgs_core.simulation.scanner import SimulatedScanner
from hgs_core.simulation.wheel_slip import WheelSlip

_TRACK_SHARE = 1.6
"""Distance between the wheels of a round robot, in radii."""


class BodyFaults(StrictConfig):
    """What is wrong with a simulated robot and its sensors; by default nothing."""

    wheel_slip: float = Field(0.0, ge=0, lt=1)
    """Greatest share of its motion that a wheel loses; see `WheelSlip`."""
    drift_percent: float = Field(0.0, ge=0, lt=100)
    """Drift of the estimated position after one metre [% of it]; see `PoseDrift`."""
    drift_deg_per_m: float = Field(0.0, ge=0, lt=90)
    """Drift of the estimated heading after one metre [degrees]."""
    depth_holes: float = Field(0.0, ge=0, lt=1)
    """Share of the depth image without a return; see `DepthHoles`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sighting:
    """What the sensors deliver at about one moment, as far as the robot knows."""

    frame: Frame
    """Its pose is the estimated one of the moment at which it was taken."""
    scan: Scan
    """Likewise its origin and bearings."""
    T_world_camera: SE3
    """Where the frame was truly taken."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenWorld:
    """Everything that a robot is: body, wheels, camera, scanner, and what is wrong with them."""

    scene: Scene
    robot: DrivenRobot
    camera: SimulatedSensor
    scanner: SimulatedScanner
    holes: DepthHoles
    camera_height_m: float

    @staticmethod
    def of(
        scene: Scene,
        *,
        robot: RobotConfig,
        camera: DepthCameraConfig,
        scanner: ScannerConfig,
        faults: BodyFaults,
        seeds: np.random.SeedSequence,
    ) -> DrivenWorld:
        """The robot at the scene's start; noise and faults draw from children of `seeds`, each from its own:
        none changes what another draws."""
        camera_rng, scanner_rng, slip_rng, drift_rng, holes_rng = map(np.random.default_rng, seeds.spawn(5))
        track_m = _TRACK_SHARE * robot.radius_m if isinstance(robot, DifferentialConfig) else None
        driven = DrivenRobot(
            robot,
            BodyObstacles(scene.mesh, robot.height_m),
            scene.start,
            slip=WheelSlip(faults.wheel_slip, track_m, slip_rng),
            drift=PoseDrift(faults.drift_percent, faults.drift_deg_per_m, drift_rng),
        )
        return DrivenWorld(
            scene=scene,
            robot=driven,
            camera=build_sensor(scene.caster, driven, camera, camera_rng),
            scanner=SimulatedScanner(scene.caster, driven, scanner, scanner_rng),
            holes=DepthHoles(faults.depth_holes, holes_rng),
            camera_height_m=camera.mount_height_m,
        )

    def sense(self) -> Sighting:
        """A scan and a frame, taken now; time may pass meanwhile, in another thread."""
        scan, frame = self.scanner.scan(), self.camera.capture()
        return Sighting(
            frame=replace(
                frame,
                depth_m=self.holes.punched(frame.depth_m),
                T_world_camera=self._believed_camera(frame.timestamp_s),
            ),
            scan=self._believed(scan),
            T_world_camera=frame.T_world_camera,
        )

    def _believed_camera(self, timestamp_s: float) -> SE3:
        at = self.robot.moment_at(timestamp_s).estimate
        return level_camera_pose(at.x_m, at.y_m, self.camera_height_m, at.yaw_rad)

    def _believed(self, scan: Scan) -> Scan:
        moment = self.robot.moment_at(scan.timestamp_s)
        at, turned = moment.estimate, wrapped(moment.estimate.yaw_rad - moment.state.yaw_rad)
        origin = np.array([at.x_m, at.y_m, float(scan.origin_m[2])])
        return replace(scan, origin_m=origin, bearings_rad=scan.bearings_rad + turned)
