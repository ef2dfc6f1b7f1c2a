"""What a mission is made of: one preset, resolved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any, Final

import yaml
from pydantic import Field, SerializeAsAny, ValidationError

from hgs_core.config.base import StrictConfig
from hgs_core.config.presets import load_preset, preset_names
from hgs_core.errors import ConfigError, Fault
from hgs_core.live.config import LiveConfig
from hgs_core.localisation.given import GivenConfig
from hgs_core.localisation.localiser import LocalisationConfig
from hgs_core.localisation.methods import localisation_config
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.refinement import RefinementConfig
from hgs_core.mapping.volume_fusion import MeshConfig
from hgs_core.mission.checkpoint_config import CheckpointConfig
from hgs_core.mission.clock import ClockKind
from hgs_core.planning.config import HierarchicalConfig, PlannerConfig
from hgs_core.planning.directives import Directives
from hgs_core.planning.registry import planner_config, planner_methods
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.robot import RobotConfig
from hgs_core.robot.vehicle import robot_config
from hgs_core.scene.options import SceneOptions
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.registry import sensor_config
from hgs_core.voxels.voxel_map import VoxelConfig

_SHARED_PRESETS: Final = ("sensor", "robot", "planner")
"""Sections that may name a preset of their own (`robot: wheeled` is `configs/robot/wheeled.yaml`)."""


class SensorConfig(StrictConfig):
    """What the robot carries."""

    camera: SerializeAsAny[DepthCameraConfig] = DepthCameraConfig()
    """The settings of one of the registered sensors."""
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
    scene: SceneOptions = SceneOptions()
    """How a mesh is placed in the world, where that is not to be found."""
    sensor: SensorConfig = SensorConfig()
    robot: SerializeAsAny[RobotConfig] = DifferentialConfig()
    """The body and how it drives: the settings of one of the vehicles."""
    voxels: VoxelConfig = VoxelConfig()
    mapping: MappingConfig = MappingConfig()
    refinement: RefinementConfig = RefinementConfig()
    mesh: MeshConfig = MeshConfig()
    planner: SerializeAsAny[PlannerConfig] = HierarchicalConfig()
    """How it decides where to look: the settings of one of the registered planners."""
    limits: MissionLimits = MissionLimits()
    directives: Directives = Directives()
    """What the operator asks of the mission from its beginning; they may ask for something else later."""
    localisation: SerializeAsAny[LocalisationConfig] = GivenConfig()
    """Where the camera is, on a live robot or in a recording; simulated missions know it (`given`)."""
    clock: ClockKind = ClockKind.LOCKSTEP
    """`lockstep`: mission time is counted, and the same seed gives the same mission; `real`: it is wall time,
    the simulator's excepted, and mapper and planner must keep up."""
    live: LiveConfig = LiveConfig()
    """What holds where the robot is a live one (scene `live`)."""
    checkpoint: CheckpointConfig = CheckpointConfig()
    threads: int = Field(2, ge=1)
    """Threads of every kernel; part of what makes a run repeatable."""
    curve_interval_m: float = Field(0.0, ge=0)
    """Metres of path between two readings of how complete the map is (`completion_curve`; simulated scenes
    only); 0 = none. A reading takes about 0.1 s of wall time and no mission time; no planner sees it."""
    curve_interval_s: float = Field(2.0, gt=0)
    """Mission time [s] after which one is taken although the robot has not driven so far."""
    evaluate: bool = True
    """Compare the finished map with the true surface (simulated scenes only; takes up to a minute)."""


def resolve_mission_config(preset: str, overrides: dict[str, str]) -> MissionConfig:
    """The mission preset with `key.sub=value` overrides applied; see `changed`.

    Raises `ConfigError` naming the field, its value and what is allowed.
    """
    content = load_preset("mission", preset)
    return changed(content, overrides, source=f"mission preset {preset!r}")


def changed(content: dict[str, Any], overrides: dict[str, str], *, source: str) -> MissionConfig:
    """A mission's resolved settings with `key.sub=value` overrides applied. Raises as above.

    `planner=NAME`, `sensor=NAME` and `robot=NAME` put another preset in the section's place, before any
    `planner.key=value` is applied.
    """
    copied = deepcopy(content)
    for key in overrides.keys() & set(_SHARED_PRESETS):
        _override(copied, key, overrides[key])
    for section in _SHARED_PRESETS:
        named = copied.get(section)
        if isinstance(named, str):
            copied[section] = _section(section, named)
    for key in [key for key in overrides if key not in _SHARED_PRESETS]:
        _override(copied, key, overrides[key])
    return _mission_config_from(copied, source=source)


def _mission_config_from(content: dict[str, Any], *, source: str) -> MissionConfig:
    try:
        content = dict(content)
        planner, sensor, robot = (content.get(key) for key in ("planner", "sensor", "robot"))
        if isinstance(planner, dict):
            content["planner"] = _plugin_config(planner_config, planner, source, "planner")
        if isinstance(robot, dict):
            content["robot"] = _plugin_config(robot_config, robot, source, "robot")
        if isinstance(content.get("localisation"), dict):
            localisation = content["localisation"]
            content["localisation"] = _plugin_config(
                localisation_config, localisation, source, "localisation"
            )
        if isinstance(sensor, dict) and isinstance(sensor.get("camera"), dict):
            camera = _plugin_config(sensor_config, sensor["camera"], source, "sensor", "camera")
            content["sensor"] = {**sensor, "camera": camera}
        return MissionConfig.model_validate(content)
    except ValidationError as error:
        raise _faults(error, source) from error


def _plugin_config(
    build: Callable[[Mapping[str, Any]], StrictConfig], content: dict[str, Any], source: str, *section: str
) -> StrictConfig:
    """Settings of the class that their `method` asks for."""
    try:
        return build(content)
    except ValidationError as error:
        raise _faults(error, source, within=section) from error


def _section(section: str, name: str) -> dict[str, Any]:
    """The preset of that name; for a planner without one, as those of other packages are, its defaults."""
    if section == "planner" and name not in preset_names(section) and name in planner_methods():
        return {"method": name}
    return load_preset(section, name)


def _faults(error: ValidationError, source: str, within: tuple[str, ...] = ()) -> ConfigError:
    faults = [
        Fault(field=".".join(map(str, (*within, *e["loc"]))), value=e["input"], message=e["msg"])
        for e in error.errors()
    ]
    lines = [f"{fault.field or '(top level)'} = {fault.value!r}: {fault.message}" for fault in faults]
    return ConfigError(f"{source} is not valid: " + "; ".join(lines), faults=faults)


def _override(content: dict[str, Any], key: str, text: str) -> None:
    *sections, field = key.split(".")
    target = content
    for section in sections:
        child = target.setdefault(section, {})
        if not isinstance(child, dict):
            raise ConfigError(f"--set {key}={text}: {section!r} is a value, not a section")
        target = child
    target[field] = _yaml_value(key, text)


class _PlainLoader(yaml.SafeLoader):
    """YAML without references to earlier nodes: a short text of them can stand for a value of any size."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.MarkedYAMLError(problem="references (*name) are not allowed")
        return super().compose_node(parent, index)


def _yaml_value(key: str, text: str) -> Any:
    try:
        return yaml.load(text, _PlainLoader)
    except (yaml.YAMLError, ValueError, ArithmeticError, RecursionError) as error:
        # Not only YAMLError: 2001-99-99 has no such month, and a thousand brackets nest too deep.
        raise ConfigError(f"--set {key}={text}: not a YAML value: {error}") from error
