"""Sensors by name: an entry point of the group `hgs.sensors` names a `SensorMethod`.

A simulated camera from another package is one file and one line in that package's `pyproject.toml`:

    [project.entry-points."hgs.sensors"]
    my-camera = "my_package.my_camera:METHOD"

Mission settings ask for it with `sensor.camera.method: my-camera`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np

from hgs_core.config.plugins import load_plugin, plugin_names
from hgs_core.errors import ConfigError
from hgs_core.robot.robot import Robot
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.frame import Frame

GROUP: Final = "hgs.sensors"


@runtime_checkable
class SimulatedSensor(Protocol):
    """A `Sensor` whose state can be kept."""

    def capture(self) -> Frame:
        """The frame seen now from where the robot is."""
        ...

    def state(self) -> dict[str, Any]:
        """Everything that later frames depend on, besides mesh, robot and settings."""
        ...

    def restore(self, state: dict[str, Any]) -> None: ...


@dataclass(frozen=True, kw_only=True)
class SensorMethod:
    """A simulated camera and its settings."""

    config: type[DepthCameraConfig]
    """Its `method` is the name of the entry point."""
    build: Callable[[RayCaster, Robot, Any, np.random.Generator], SimulatedSensor]
    """From the scene's rays, the robot that carries it, an instance of `config`, and what its noise draws
    from."""


def sensor_methods() -> list[str]:
    """Names of all registered sensors."""
    return plugin_names(GROUP)


def sensor_method(name: str) -> SensorMethod:
    """Raises `ConfigError` naming what there is."""
    method = load_plugin(GROUP, name, kind="sensor")
    if not isinstance(method, SensorMethod):
        raise ConfigError(f"sensor {name!r} is registered as a {type(method).__name__}, not a SensorMethod")
    return method


def sensor_config(content: Mapping[str, Any]) -> DepthCameraConfig:
    """The settings of the sensor that `content["method"]` names (`rgbd` without one).

    Raises `ConfigError` for an unknown method and pydantic's `ValidationError` for wrong settings.
    """
    name = content.get("method", "rgbd")
    if not isinstance(name, str):
        raise ConfigError(f"sensor.camera.method = {name!r}: must be one of {', '.join(sensor_methods())}")
    return sensor_method(name).config.model_validate(dict(content))


def build_sensor(
    caster: RayCaster, robot: Robot, config: DepthCameraConfig, rng: np.random.Generator
) -> SimulatedSensor:
    """The sensor that `config.method` names."""
    return sensor_method(config.method).build(caster, robot, config, rng)
