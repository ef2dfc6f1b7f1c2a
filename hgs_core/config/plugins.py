"""Parts found by entry point: those of this package and of any other that is installed beside it."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

from hgs_core.errors import ConfigError


def plugin_names(group: str) -> list[str]:
    """Names registered in an entry-point group, sorted."""
    return sorted({entry.name for entry in entry_points(group=group)})


def load_plugin(group: str, name: str, *, kind: str) -> Any:
    """The object registered under `name`; `kind` says in messages what it is (`planner`).

    Raises `ConfigError` naming what there is, or what is wrong with the package that registered it.
    """
    found = entry_points(group=group, name=name)
    if not found:
        there_are = ", ".join(plugin_names(group)) or "none"
        raise ConfigError(f"no {kind} {name!r}; there are: {there_are}")
    origins = sorted({entry.value for entry in found})
    if len(origins) > 1:
        raise ConfigError(f"{kind} {name!r} is registered more than once: {', '.join(origins)}")
    try:
        return next(iter(found)).load()
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"{kind} {name!r} cannot be loaded from {origins[0]}: {error}") from error
