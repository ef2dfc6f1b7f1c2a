"""A mission's settings described for a form: JSON Schema with meanings, ranges and defaults."""

from __future__ import annotations

from typing import Any

from pydantic import create_model

from hgs_core.config.presets import preset_names
from hgs_core.mission.config import MissionConfig, SensorConfig
from hgs_core.planning.registry import planner_methods


def settings_schema(config: MissionConfig) -> dict[str, Any]:
    """JSON Schema (2020-12) of the settings that `config` has: those of its own planner, sensor, robot
    and localisation; the former two may come from another package."""
    camera, planner, robot = config.sensor.camera, config.planner, config.robot
    localisation = config.localisation
    sensor: Any = create_model("Sensor", __base__=SensorConfig, camera=(type(camera), camera))
    # `create_model` has no overload for fields from a mapping of computed types.
    fields: dict[str, Any] = {
        "planner": (type(planner), planner),
        "robot": (type(robot), robot),
        "localisation": (type(localisation), localisation),
        "sensor": (sensor, sensor()),
    }
    described = create_model("MissionSettings", __base__=MissionConfig, **fields)
    return described.model_json_schema()


def planner_names() -> list[str]:
    """What `planner=NAME` can put in a preset's place: presets, and planners that have none."""
    return sorted({*preset_names("planner"), *planner_methods()})
