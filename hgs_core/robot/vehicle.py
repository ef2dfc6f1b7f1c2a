"""What a robot's drive is to planning, simulation and whoever sends it a path: three models, one protocol.

| `drive` | |
|---|---|
| `differential` | turns on the spot, drives straight ahead |
| `holonomic` | drives in any direction and turns meanwhile |
| `ackermann` | a car: turns only while it drives, forwards or backwards, no tighter than a radius |
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Protocol, runtime_checkable

from hgs_core.errors import ConfigError
from hgs_core.robot.ackermann import Ackermann, AckermannConfig
from hgs_core.robot.differential import Differential, DifferentialConfig
from hgs_core.robot.holonomic import Holonomic, HolonomicConfig
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.robot.timed_path import TimedPath


@runtime_checkable
class Vehicle(Protocol):
    """One way of driving."""

    @property
    def config(self) -> RobotConfig: ...

    def first_look(self, state: RobotState) -> Path:
        """What it does to look around before it knows anything of the world; may be empty."""
        ...

    def timed(self, path: Path, yaw_rad: float) -> TimedPath:
        """When it is where if it follows a path of at least one waypoint from a stand there, heading
        `yaw_rad`, and stands at its end. Raises `RobotError` for a path that it cannot drive."""
        ...


_CONFIGS: Final[dict[str, type[RobotConfig]]] = {
    "differential": DifferentialConfig,
    "holonomic": HolonomicConfig,
    "ackermann": AckermannConfig,
}


def robot_config(content: Mapping[str, Any]) -> RobotConfig:
    """The settings of the vehicle that `content["drive"]` names (default: differential).

    Raises `ConfigError` for an unknown drive and pydantic's `ValidationError` for wrong settings.
    """
    drive = content.get("drive", "differential")
    if not isinstance(drive, str) or drive not in _CONFIGS:
        raise ConfigError(f"robot.drive = {drive!r}: must be one of {', '.join(_CONFIGS)}")
    return _CONFIGS[drive].model_validate(dict(content))


def vehicle_of(config: RobotConfig) -> Vehicle:
    """Raises `ConfigError` for settings that are of none of the vehicles."""
    if isinstance(config, AckermannConfig):
        return Ackermann(config)
    if isinstance(config, HolonomicConfig):
        return Holonomic(config)
    if isinstance(config, DifferentialConfig):
        return Differential(config)
    raise ConfigError(f"{type(config).__name__} is of no vehicle: expected one of {', '.join(_CONFIGS)}")
