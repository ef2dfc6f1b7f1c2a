"""Planners by name: an entry point of the group `hgs.planners` names a `PlannerMethod`.

A planner from another package is one file and one line in that package's `pyproject.toml`:

    [project.entry-points."hgs.planners"]
    my-planner = "my_package.my_planner:METHOD"
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from hgs_core.config.plugins import load_plugin, plugin_names
from hgs_core.errors import ConfigError
from hgs_core.planning.config import PlannerConfig
from hgs_core.planning.plan import Planner
from hgs_core.planning.survey import PlannerContext

GROUP: Final = "hgs.planners"


@dataclass(frozen=True, kw_only=True)
class PlannerMethod:
    """A planner and its settings."""

    config: type[PlannerConfig]
    """Its `method` is the name of the entry point."""
    build: Callable[[Any, PlannerContext], Planner]
    """From an instance of `config` and what is known of the robot."""


def planner_methods() -> list[str]:
    """Names of all registered planners."""
    return plugin_names(GROUP)


def planner_method(name: str) -> PlannerMethod:
    """Raises `ConfigError` naming what there is."""
    method = load_plugin(GROUP, name, kind="planner")
    if not isinstance(method, PlannerMethod):
        raise ConfigError(f"planner {name!r} is registered as a {type(method).__name__}, not a PlannerMethod")
    return method


def planner_config(content: Mapping[str, Any]) -> PlannerConfig:
    """The settings of the planner that `content["method"]` names. A `description` is for whoever chooses.

    Raises `ConfigError` for an unknown method and pydantic's `ValidationError` for wrong settings.
    """
    name = content.get("method")
    if not isinstance(name, str):
        raise ConfigError(f"planner.method = {name!r}: must be one of {', '.join(planner_methods())}")
    settings = {key: value for key, value in content.items() if key != "description"}
    return planner_method(name).config.model_validate(settings)


def build_planner(config: PlannerConfig, context: PlannerContext) -> Planner:
    return planner_method(config.method).build(config, context)
