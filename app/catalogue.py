"""Which scenes and presets a mission can be made of."""

from __future__ import annotations

import functools
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.errors import Conflict, Invalid, NotFound
from app.missions.directives import without_directives
from app.missions.service import MissionOrder
from app.schemas import MissionCreate, PresetEntry, PresetSave, PresetSettings, SceneEntry
from app.storage.presets import PresetStore
from app.storage.tables import PresetRecord
from hgs_core.config.presets import load_preset, preset_names
from hgs_core.errors import ConfigError, SceneError
from hgs_core.mission.config import resolve_mission_config
from hgs_core.mission.settings_schema import planner_names, settings_schema
from hgs_core.scene.built_in import BUILT_IN_SCENES, built_in_scene
from hgs_core.scene.registry import find_source, scene_names


class Catalogue:
    """Scenes by name, and the meshes and scans directly in `scenes_dir`; built-in and saved presets."""

    def __init__(self, scenes_dir: Path | None, saved: PresetStore) -> None:
        self._scenes_dir = scenes_dir
        self._saved = saved

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
        """Built-in ones, then those that operators saved."""
        built_in = [_built_in(name) for name in preset_names("mission")]
        return [*built_in, *(_saved_entry(record) for record in self._saved.all())]

    def preset(self, name: str) -> PresetEntry:
        """Raises `NotFound`."""
        if name in preset_names("mission"):
            return _built_in(name)
        record = self._saved.find(name)
        if record is None:
            raise NotFound(f"there is no preset {name!r}")
        return _saved_entry(record)

    def settings(self, name: str, *, planner: str | None = None) -> PresetSettings:
        """Every setting of a preset; of another planner where one is named. Raises `NotFound`, `Invalid`."""
        entry = self.preset(name)
        planners = planner_names()
        if planner is not None and planner not in planners:
            raise _refusal([_unknown("planner", planner, planners)])
        overrides = entry.overrides if planner is None else {**entry.overrides, "planner": planner}
        config = resolve_mission_config(entry.base, overrides)
        return PresetSettings(
            settings_schema=settings_schema(config), values=config.model_dump(mode="json"), planners=planners
        )

    def save_preset(self, name: str, wish: PresetSave, *, saved_by: str) -> tuple[PresetEntry, bool]:
        """Add or replace a preset; whether it is new. Raises `Conflict` for a built-in one, `Invalid`."""
        names = preset_names("mission")
        if name in names:
            raise Conflict(f"preset {name!r} is built in: save yours under another name")
        errors = (
            [_unknown("base", wish.base, names)]
            if wish.base not in names
            else _refused_overrides(wish.base, wish.overrides)
        )
        if errors:
            raise _refusal(errors)
        record = PresetRecord(
            name=name,
            base=wish.base,
            description=wish.description,
            overrides=dict(wish.overrides),
            saved_by=saved_by,
            saved_at=time.time(),
        )
        return _saved_entry(record), self._saved.save(record)

    def delete_preset(self, name: str) -> None:
        """Raises `NotFound`, or `Conflict` for a built-in one. Missions made of it are as they were."""
        if name in preset_names("mission"):
            raise Conflict(f"preset {name!r} is built in and stays")
        if not self._saved.delete(name):
            raise NotFound(f"there is no preset {name!r}")

    def order(self, wish: MissionCreate) -> MissionOrder:
        """`wish`, names resolved. Raises `Invalid` that names the field, its value and what there is."""
        errors: list[dict[str, Any]] = []
        source = self._source(wish.scene)
        if source is None:
            scenes = [*(scene.name for scene in self.scenes()), *(f"{name}:SEED" for name in BUILT_IN_SCENES)]
            errors.append(_unknown("scene", wish.scene, scenes))
        base, overrides = wish.preset, dict(wish.overrides)
        if base not in preset_names("mission"):
            saved = self._saved.find(base)
            if saved is None:
                errors.append(_unknown("preset", base, [entry.name for entry in self.presets()]))
            else:
                base, overrides = saved.base, {**saved.overrides, **overrides}
        directives = wish.directives
        if base in preset_names("mission"):
            try:
                config = resolve_mission_config(base, overrides)
                directives = config.directives if directives is None else directives
            except ConfigError as error:
                errors += _refused(overrides, error)
        if errors or source is None or directives is None:
            raise _refusal(errors)
        return MissionOrder(
            scene=wish.scene,
            scene_source=source,
            preset=wish.preset,
            preset_source=base,
            seed=wish.seed,
            max_time_s=wish.max_time_s,
            clock=wish.clock,
            extends=wish.extends,
            overrides=without_directives(overrides),
            directives=directives,
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


def _built_in(name: str) -> PresetEntry:
    content = load_preset("mission", name)
    description = str(content.pop("description", ""))
    return PresetEntry(
        name=name, description=description, built_in=True, base=name, overrides={}, content=content
    )


def _saved_entry(record: PresetRecord) -> PresetEntry:
    return PresetEntry(
        name=record.name,
        description=record.description,
        built_in=False,
        base=record.base,
        overrides=record.overrides,
        content=_built_in(record.base).content,
    )


def _refusal(errors: list[dict[str, Any]]) -> Invalid:
    return Invalid("; ".join(str(error["message"]) for error in errors), errors=errors)


def _refused_overrides(preset: str, overrides: Mapping[str, str]) -> list[dict[str, Any]]:
    """What the mission's configuration has against the overrides, in its own words."""
    try:
        resolve_mission_config(preset, dict(overrides))
    except ConfigError as error:
        return _refused(overrides, error)
    return []


def _refused(overrides: Mapping[str, str], error: ConfigError) -> list[dict[str, Any]]:
    if not error.faults:
        return [{"field": "overrides", "value": dict(overrides), "message": str(error)}]
    return [
        {
            "field": f"overrides.{fault.field}",
            "value": overrides.get(fault.field),
            "message": f"{fault.field} = {fault.value!r}: {fault.message}"[:500],
        }
        for fault in error.faults
    ]


def time_limit_s(preset_source: str, overrides: Mapping[str, str]) -> float | None:
    """The limit of mission time [s] that a preset and settings of it amount to; None where they are not (any
    more) those of a mission: records outlive versions."""
    return _time_limit_s(preset_source, tuple(sorted(overrides.items())))


@functools.lru_cache(maxsize=256)
def _time_limit_s(preset_source: str, overrides: tuple[tuple[str, str], ...]) -> float | None:
    try:
        return resolve_mission_config(preset_source, dict(overrides)).limits.max_time_s
    except ConfigError:
        return None


def _unknown(field: str, value: str, allowed: list[str]) -> dict[str, Any]:
    return {
        "field": field,
        "value": value,
        "message": f"{field} {value!r} is not known; there are: {', '.join(allowed)}",
        "allowed": allowed,
    }
