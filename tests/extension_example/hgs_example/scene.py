"""`corridor:LENGTH`: an empty corridor 2 m wide and 2.5 m high, of so many metres."""

from __future__ import annotations

import numpy as np

from hgs_core.errors import SceneError
from hgs_core.scene.source import RawScene, SceneSource
from hgs_core.scene.textured_mesh import Material, TexturedMesh

# The corners of a box by their bits (x, y, z), and its six sides.
_SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def claims(scene: str) -> bool:
    return scene.partition(":")[0] == "corridor"  # cheap: asked for every name and path


def read(scene: str) -> RawScene:
    _, _, length = scene.partition(":")
    if not length.isdecimal() or not 2 <= int(length) <= 100:
        raise SceneError(f"{scene!r} is no corridor: expected corridor:LENGTH with LENGTH = 2 .. 100 metres")
    size = np.array([float(length), 2.0, 2.5])
    corners = np.array([[(i >> 2) & 1, (i >> 1) & 1, i & 1] for i in range(8)]) * size
    triangles = np.array([side[k : k + 3] for side in _fans() for k in (0, 3)], dtype=np.int32)
    mesh = TexturedMesh(
        vertices_m=corners.astype(np.float32),
        triangles=triangles,
        uv=np.zeros((len(triangles), 3, 2), dtype=np.float32),
        material_index=np.arange(len(triangles), dtype=np.int32) // 2,
        materials=tuple(Material(name=f"side {i}", factor=(0.4 + 0.1 * i, 0.6, 0.5)) for i in range(6)),
    )
    # z up, metres, floor at z = 0. A mesh in a frame of its own says what is known of it instead:
    # RawScene(..., known=SceneOptions(up_axis="y", scale=0.01)).
    return RawScene(name=scene, mesh=mesh, in_world=True)


def _fans() -> list[tuple[int, ...]]:
    return [(a, b, c, a, c, d) for a, b, c, d in _SIDES]


SOURCE = SceneSource(
    opens="corridor:LENGTH, a straight corridor",
    claims=claims,
    read=read,
    names={"corridor": "an empty corridor of the given length, e.g. corridor:12"},
)
