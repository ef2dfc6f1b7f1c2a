"""What a mission is made of: one preset, resolved."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Final

import yaml
from pydantic import Field, ValidationError

from hgs_core.config.base import StrictConfig
from hgs_core.config.presets import load_preset
from hgs_core.errors import ConfigError
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.refinement import RefinementConfig
from hgs_core.mapping.volume_fusion import MeshConfig
from hgs_core.mission.clock import ClockKind
from hgs_core.planning.config import PlannerConfig
from hgs_core.robot.robot import RobotConfig
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.voxels.voxel_map import VoxelConfig

_SHARED_PRESETS: Final = ("sensor", "robot", "planner")
"""Sections that may name a preset of their own (`robot: wheeled` is `configs/robot/wheeled.yaml`)."""


class SensorConfig(StrictConfig):
    """What the robot carries."""

    camera: DepthCameraConfig = DepthCameraConfig()
    scanner: ScannerConfig = ScannerConfig()


class MissionLimits(StrictConfig):
    """When a mission ends although there is more to see, and what thinking costs."""

    max_time_s: float = Field(3600.0, gt=0)
    """Mission time [s] after which the mission ends with `time_limit`."""
    planning_time_s: float = Field(0.1, ge=0)
    """Mission time [s] that one planning cycle costs under the lockstep clock; the robot stands meanwhile.
    Under the real clock it costs what it takes."""
    stuck_after_plans: int = Field(25, ge=2)
    """So many plans in a row without moving or turning end the mission with `stuck`."""


class MissionConfig(StrictConfig):
    """Everything that decides a mission except scene and seed."""

    description: str
    """One sentence for whoever chooses a preset."""
    sensor: SensorConfig = SensorConfig()
    robot: RobotConfig = RobotConfig()
    voxels: VoxelConfig = VoxelConfig()
    mapping: MappingConfig = MappingConfig()
    refinement: RefinementConfig = RefinementConfig()
    mesh: MeshConfig = MeshConfig()
    gain: GainConfig = GainConfig()
    planner: PlannerConfig = PlannerConfig()
    limits: MissionLimits = MissionLimits()
    clock: ClockKind = ClockKind.LOCKSTEP
    """`lockstep`: mission time is counted, and the same seed gives the same mission; `real`: it is wall time,
    the simulator's excepted, and mapper and planner must keep up."""
    threads: int = Field(2, ge=1)
    """Threads of every kernel; part of what makes a run repeatable."""
    evaluate: bool = True
    """Compare the finished map with the true surface (simulated scenes only; takes up to a minute)."""


def resolve_mission_config(preset: str, overrides: dict[str, str]) -> MissionConfig:
    """The mission preset with `key.sub=value` overrides applied.

    Raises `ConfigError` naming the field, its value and what is allowed.
    """
    content = load_preset("mission", preset)
    for section in _SHARED_PRESETS:
        named = content.get(section)
        if isinstance(named, str):
            content[section] = load_preset(section, named)
    return changed(content, overrides, source=f"mission preset {preset!r}")


def changed(content: dict[str, Any], overrides: dict[str, str], *, source: str) -> MissionConfig:
    """A mission's resolved settings with `key.sub=value` overrides applied. Raises as above."""
    copied = deepcopy(content)
    for key, text in overrides.items():
        _override(copied, key, text)
    return _mission_config_from(copied, source=source)


def _mission_config_from(content: dict[str, Any], *, source: str) -> MissionConfig:
    try:
        return MissionConfig.model_validate(content)
    except ValidationError as error:
        lines = [
            f"{'.'.join(map(str, e['loc'])) or '(top level)'} = {e['input']!r}: {e['msg']}"
            for e in error.errors()
        ]
        raise ConfigError(f"{source} is not valid: " + "; ".join(lines)) from error


def _override(content: dict[str, Any], key: str, text: str) -> None:
    *sections, field = key.split(".")
    target = content
    for section in sections:
        child = target.setdefault(section, {})
        if not isinstance(child, dict):
            raise ConfigError(f"--set {key}={text}: {section!r} is a value, not a section")
        target = child
    target[field] = yaml.safe_load(text)
