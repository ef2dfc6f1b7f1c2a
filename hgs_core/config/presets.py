"""Presets: YAML files under `configs/`, one folder a subject (mission, sensor, robot, planner, scene)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from hgs_core.errors import ConfigError


def presets_root() -> Path:
    """`configs/` of the checkout, or its copy inside the installed package."""
    package = Path(__file__).resolve().parents[1]
    for root in (package.parent / "configs", package / "configs"):
        if (root / "mission").is_dir():
            return root
    raise ConfigError(f"no presets beside {package}: reinstall the package")


def preset_names(subject: str) -> list[str]:
    return sorted(path.stem for path in (presets_root() / subject).glob("*.yaml"))


def load_preset(subject: str, name: str) -> dict[str, Any]:
    """The mapping in `configs/SUBJECT/NAME.yaml`. Raises `ConfigError` naming what there is."""
    path = presets_root() / subject / f"{name}.yaml"
    if not path.is_file() or path.parent != presets_root() / subject:
        raise ConfigError(f"no {subject} preset {name!r}; there are: {', '.join(preset_names(subject))}")
    return load_yaml(path)


def load_yaml(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ConfigError(f"{path} is not valid YAML: {error}") from error
    if not isinstance(content, dict):
        raise ConfigError(f"{path} must hold a mapping, it holds {type(content).__name__}")
    return content
