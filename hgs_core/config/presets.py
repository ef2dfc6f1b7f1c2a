"""Presets: YAML files under `configs/`, one folder a subject (mission, sensor, robot, planner, scene).

A preset that says `extends: OTHER` is that other preset of its subject, with what it holds itself on top.
"""

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
    """Names that `load_preset` takes, sorted. Raises `ConfigError` for a subject without a folder."""
    folder = presets_root() / subject
    subjects = sorted(path.name for path in presets_root().iterdir() if path.is_dir())
    if subject not in subjects:
        raise ConfigError(f"no presets about {subject!r}; there are presets about: {', '.join(subjects)}")
    return sorted(path.stem for path in folder.glob("*.yaml"))


def load_preset(subject: str, name: str) -> dict[str, Any]:
    """The mapping in `configs/SUBJECT/NAME.yaml`, on top of the preset that it extends.

    Raises `ConfigError` naming what there is.
    """
    names = preset_names(subject)
    if name not in names:
        raise ConfigError(f"no {subject} preset {name!r}; there are: {', '.join(names) or 'none'}")
    content = load_yaml(presets_root() / subject / f"{name}.yaml")
    extended = content.pop("extends", None)
    return content if extended is None else _on_top(load_preset(subject, extended), content)


def _on_top(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Both mappings in one, section by section; what stands above counts."""
    merged = dict(below)
    for key, value in above.items():
        known = merged.get(key)
        merged[key] = _on_top(known, value) if isinstance(known, dict) and isinstance(value, dict) else value
    return merged


def load_yaml(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file. Raises `ConfigError` when it cannot be read or holds anything else."""
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"cannot read {path}: {error.strerror}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} is not valid YAML: {error}") from error
    if not isinstance(content, dict):
        raise ConfigError(f"{path} must hold a mapping, it holds {type(content).__name__}")
    return content
