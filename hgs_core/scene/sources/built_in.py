"""Scenes made from a seed: `NAME` or `NAME:SEED`."""

from __future__ import annotations

from hgs_core.errors import SceneError
from hgs_core.scene.built_in import BUILT_IN_SCENES, built_in_scene
from hgs_core.scene.options import SceneOptions
from hgs_core.scene.source import RawScene, SceneSource


def claims(scene: str) -> bool:
    return scene.partition(":")[0] in BUILT_IN_SCENES


def read(scene: str) -> RawScene:
    """Raises `SceneError` for a built-in name with something else than a seed."""
    # The builders take a while to import: not for lists of scenes.
    from hgs_core.scene.procedural.house import build_building, build_house, build_warren, warren_start

    named = built_in_scene(scene)
    if named is None:
        raise SceneError(f"no built-in scene {scene!r}; there are: {', '.join(BUILT_IN_SCENES)}")
    name, seed = named
    build = {"house": build_house, "building": build_building, "warren": build_warren}[name]
    known = SceneOptions(start=warren_start(seed)) if name == "warren" else SceneOptions()
    return RawScene(name=f"{name}:{seed}" if seed else name, mesh=build(seed), in_world=True, known=known)


SOURCE = SceneSource(
    opens=", ".join(f"{name} or {name}:SEED" for name in BUILT_IN_SCENES),
    claims=claims,
    read=read,
    names=BUILT_IN_SCENES,
)
