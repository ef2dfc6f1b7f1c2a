"""A camera that loses a random share of its depth pixels in every frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field

from hgs_core.robot.robot import Robot
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.frame import Frame
from hgs_core.simulation.camera import SimulatedCamera
from hgs_core.simulation.registry import SensorMethod


class DropoutConfig(DepthCameraConfig):
    """Settings: `--set sensor.camera.lost_share=0.3`; size, range and the rest are those of any camera."""

    method: Literal["dropout"] = "dropout"  # the entry point's name
    lost_share: float = Field(0.1, ge=0, lt=1)
    """Share of the pixels without a return."""


class DropoutCamera:
    """Wraps the built-in camera; what it draws is part of its state, so that missions repeat."""

    def __init__(
        self, caster: RayCaster, robot: Robot, config: DropoutConfig, rng: np.random.Generator
    ) -> None:
        (lost,) = rng.spawn(1)  # leaves the noise of the camera within as it is
        self._within = SimulatedCamera(caster, robot, config, rng)
        self._lost_share = config.lost_share
        self._rng = lost

    def capture(self) -> Frame:
        frame = self._within.capture()
        lost = self._rng.random(frame.depth_m.shape) < self._lost_share
        return replace(frame, depth_m=np.where(lost, np.float32(0.0), frame.depth_m))  # 0 = no return

    def state(self) -> dict[str, Any]:
        return {"within": self._within.state(), "rng": self._rng.bit_generator.state}

    def restore(self, state: dict[str, Any]) -> None:
        self._within.restore(state["within"])
        self._rng.bit_generator.state = state["rng"]


METHOD = SensorMethod(config=DropoutConfig, build=DropoutCamera)
