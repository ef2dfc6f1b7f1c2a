"""`SceneSource`: one kind of name, file or folder that scenes come from. Light to import."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from hgs_core.scene.options import SceneOptions
from hgs_core.scene.textured_mesh import TexturedMesh


@dataclass(frozen=True, kw_only=True, eq=False)
class RawScene:
    """A mesh as its source delivers it, and what the source knows of it."""

    name: str
    """For reports and lists."""
    mesh: TexturedMesh
    in_world: bool = False
    """The mesh is in the world frame already (z up, metres, floor at z = 0): nothing of it is looked for, and
    only a start may be given."""
    known: SceneOptions = SceneOptions()
    """What need not be found for a mesh in a frame of its own; options given by hand come before it."""
    notices: tuple[str, ...] = ()
    """Every choice that was made, and everything that could not be kept."""


@dataclass(frozen=True, kw_only=True)
class SceneSource:
    """Which scenes there are of one kind, and how one is read."""

    opens: str
    """What it takes, for lists and messages: names, or the paths and files that it looks for."""
    claims: Callable[[str], bool]
    """Whether a name or path is one of its own; cheap, and never raises."""
    read: Callable[[str], RawScene]
    """The scene that a claimed name or path stands for. Raises `SceneError` that says what was found, what
    was expected and what to do."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Scenes that need no file, and what each is. `NAME:...` belongs to the source as `NAME` does."""
    general: bool = False
    """Asked only where no other source claims."""
