"""Names of the built-in scenes; light to import, unlike what makes them."""

from __future__ import annotations

from typing import Final

from hgs_core.errors import SceneError

BUILT_IN_SCENES: Final = {
    "house": "five or six furnished rooms, about 100 m2",
    "building": "an office floor of two corridors and some thirty rooms, more than 1000 m2",
    "warren": "one room or many, narrow corridors and doors, loops; the robot starts in a dead end",
}


def built_in_scene(source: str) -> tuple[str, int] | None:
    """Name and seed in `NAME` or `NAME:SEED`, None for anything else.

    Raises `SceneError` for a built-in name with something else than a seed.
    """
    name, colon, seed = source.partition(":")
    if name not in BUILT_IN_SCENES:
        return None
    if not colon:
        return name, 0
    if not seed.isdecimal() or len(seed) > 9:
        raise SceneError(
            f"{source!r} names no {name}: expected {name} or {name}:SEED with SEED = 0, 1, 2, ..."
        )
    return name, int(seed)
