"""The scene that nobody knows: where a live robot is."""

from __future__ import annotations

from typing import Final

from hgs_core.errors import SceneError
from hgs_core.scene.source import RawScene, SceneSource

LIVE: Final = "live"
"""The scene of missions whose robot is a real one, or another program."""


def claims(scene: str) -> bool:
    return scene == LIVE


def read(scene: str) -> RawScene:
    """Raises `SceneError`: there is no mesh of it."""
    raise SceneError(
        f"{scene!r} is where a robot really is: no mesh of it is known, to drive in or to compare with"
    )


SOURCE = SceneSource(
    opens=f"{LIVE} (a robot that connects to the service)",
    claims=claims,
    read=read,
    names={LIVE: "where a robot is that connects to the service"},
)
