"""Scene sources by entry point: one of the group `hgs.scenes` names a `SceneSource`.

A source from another package is one file and one line in that package's `pyproject.toml`:

    [project.entry-points."hgs.scenes"]
    my-scenes = "my_package.my_scenes:SOURCE"
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hgs_core.config.plugins import load_plugin, plugin_names
from hgs_core.errors import ConfigError, SceneError
from hgs_core.scene.source import SceneSource

GROUP: Final = "hgs.scenes"
_LISTED: Final = 8
"""So many names in a message are enough to recognise a folder."""


def scene_sources() -> dict[str, SceneSource]:
    """All registered sources by name."""
    return {name: _source(name) for name in plugin_names(GROUP)}


def scene_names() -> dict[str, str]:
    """Scenes that need no file, and what each is."""
    return {name: what for source in scene_sources().values() for name, what in source.names.items()}


def find_source(scene: str) -> SceneSource | None:
    """The source that claims a name or path; None where there is none.

    Raises `ConfigError` where several do: a scene has one meaning.
    """
    claiming = {name: source for name, source in scene_sources().items() if source.claims(scene)}
    special = {name: source for name, source in claiming.items() if not source.general}
    chosen = special or claiming
    if len(chosen) > 1:
        raise ConfigError(
            f"scene {scene!r} is claimed by several sources: {', '.join(chosen)}. Rename it, or uninstall "
            "the package that should not have it"
        )
    return next(iter(chosen.values()), None)


def source_of(scene: str) -> SceneSource:
    """The source that claims a name or path. Raises `SceneError` saying what is there instead."""
    source = find_source(scene)
    if source is None:
        raise SceneError(_unclaimed(scene))
    return source


def _source(name: str) -> SceneSource:
    source = load_plugin(GROUP, name, kind="scene source")
    if not isinstance(source, SceneSource):
        raise ConfigError(
            f"scene source {name!r} is registered as a {type(source).__name__}, not a SceneSource"
        )
    return source


def _unclaimed(scene: str) -> str:
    path = Path(scene)
    expected = "; ".join(f"{name}: {source.opens}" for name, source in scene_sources().items())
    if path.is_dir():
        inside = sorted(path.iterdir())
        scenes = [child.name for child in inside if child.is_dir() and find_source(str(child)) is not None]
        if scenes:
            return f"{path} is a folder of scenes, not a scene: give one of them ({_some(scenes)})"
        found = _some([child.name + "/" * child.is_dir() for child in inside]) or "nothing"
        return f"{path} is not the folder of a scene: it holds {found}. What can be opened: {expected}"
    if path.exists():
        return f"{path} is not a mesh file or anything else that can be opened: {expected}"
    return f"no scene file, folder or name {scene!r}. What can be opened: {expected}"


def _some(names: list[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more
