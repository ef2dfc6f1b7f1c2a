"""Which scenes and presets a mission can be made of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from app.errors import Invalid
from app.missions.service import MissionOrder
from app.schemas import MissionCreate, PresetEntry, SceneEntry
from hgs_core.config.presets import load_preset, preset_names
from hgs_core.errors import ConfigError, SceneError
from hgs_core.mission.config import resolve_mission_config
from hgs_core.scene.built_in import BUILT_IN_SCENES, built_in_scene
from hgs_core.scene.registry import find_source, scene_names


class Catalogue:
    """Scenes that go by a name, and the meshes and scans directly in `scenes_dir`."""

    def __init__(self, scenes_dir: Path | None) -> None:
        self._scenes_dir = scenes_dir

    def scenes(self) -> list[SceneEntry]:
        named = [_named(name, what) for name, what in scene_names().items()]
        files = [
            SceneEntry(
                name=path.name,
                kind="folder" if path.is_dir() else "file",
                description=_description(path),
            )
            for path in self._files().values()
        ]
        return [*named, *files]

    def presets(self) -> list[PresetEntry]:
        entries = []
        for name in preset_names("mission"):
            content = load_preset("mission", name)
            description = str(content.pop("description", ""))
            entries.append(PresetEntry(name=name, description=description, content=content))
        return entries

    def order(self, wish: MissionCreate) -> MissionOrder:
        """`wish`, names resolved. Raises `Invalid` that names the field, its value and what there is."""
        errors: list[dict[str, Any]] = []
        source = self._source(wish.scene)
        if source is None:
            scenes = [*(scene.name for scene in self.scenes()), *(f"{name}:SEED" for name in BUILT_IN_SCENES)]
            errors.append(_unknown("scene", wish.scene, scenes))
        presets = preset_names("mission")
        if wish.preset not in presets:
            errors.append(_unknown("preset", wish.preset, presets))
        else:
            errors += _refused_overrides(wish)
        if errors or source is None:
            detail = "; ".join(str(error["message"]) for error in errors)
            raise Invalid(detail, errors=errors)
        return MissionOrder(
            scene=wish.scene,
            scene_source=source,
            preset=wish.preset,
            seed=wish.seed,
            max_time_s=wish.max_time_s,
            clock=wish.clock,
            overrides=dict(wish.overrides),
        )

    def _source(self, scene: str) -> str | None:
        try:
            if built_in_scene(scene) is not None:
                return scene
        except SceneError:
            return None
        if scene.partition(":")[0] in scene_names():
            return scene
        path = self._files().get(scene)
        return str(path) if path is not None else None

    def _files(self) -> dict[str, Path]:
        """Meshes and scans by name; only what lies in the folder itself, so that no name leads elsewhere."""
        if self._scenes_dir is None:
            return {}
        return {
            path.name: path
            for path in sorted(self._scenes_dir.iterdir())
            if find_source(str(path)) is not None
        }


def _named(name: str, what: str) -> SceneEntry:
    if name in BUILT_IN_SCENES:
        description = f"{what[0].upper()}{what[1:]}; {name}:SEED is another layout"
        return SceneEntry(name=name, kind="built-in", description=description)
    return SceneEntry(name=name, kind="named", description=what)


def _description(path: Path) -> str:
    """From the JSON beside the mesh where there is one; else its size, or which kind of scan it is."""
    if path.is_dir():
        source = find_source(str(path))
        return source.opens if source is not None else ""
    facts = path.with_suffix(".json")
    size = f"{path.stat().st_size / 1e6:.1f} MB"
    if facts.is_file():
        try:
            content = json.loads(facts.read_text(encoding="utf-8"))
        except (json.JSONDecodeError, UnicodeDecodeError):
            return f"{size}; {facts.name} beside it is not JSON"
        for key in ("description", "title", "name"):
            if isinstance(content, dict) and isinstance(content.get(key), str):
                return f"{content[key]} ({size})"
    return size


def _refused_overrides(wish: MissionCreate) -> list[dict[str, Any]]:
    """What the mission's configuration has against the overrides, in its own words."""
    try:
        resolve_mission_config(wish.preset, dict(wish.overrides))
    except ConfigError as error:
        return [{"field": "overrides", "value": dict(wish.overrides), "message": str(error)}]
    return []


def _unknown(field: str, value: str, allowed: list[str]) -> dict[str, Any]:
    return {
        "field": field,
        "value": value,
        "message": f"{field} {value!r} is not known; there are: {', '.join(allowed)}",
        "allowed": allowed,
    }
