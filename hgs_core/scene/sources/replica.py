"""Replica: eighteen rooms and flats of clean, dense quads with a colour a vertex.

Straub et al., "The Replica Dataset: A Digital Replica of Indoor Spaces", 2019. One folder a scene, z up and
in metres:

    apartment_0/mesh.ply                       dense quads, 8 bit colours of the vertices
    apartment_0/textures/, glass.sur, preseg.*, semantic.*
    apartment_0/habitat/mesh_semantic.ply      the same quads with object numbers

`mesh.ply` is what is read. The textures are not: they have a tile for every quad, in an order that an
unstable sort left behind and the download does not hold. The vertices' colours stand in for them.
"""

from __future__ import annotations

from pathlib import Path

from hgs_core.errors import SceneError
from hgs_core.scene.options import SceneOptions
from hgs_core.scene.source import RawScene, SceneSource

_MESH = "mesh.ply"
_COMPANIONS = ("glass.sur", "habitat", "preseg.json", "semantic.json", "textures")


def claims(scene: str) -> bool:
    path = Path(scene)
    folder = path.parent if path.name == _MESH and path.is_file() else path
    # One companion may lie beside anybody's mesh.ply; without the mesh two tell that it is missing.
    beside = sum((folder / name).exists() for name in _COMPANIONS) if folder.is_dir() else 0
    return beside >= (1 if (folder / _MESH).is_file() else 2)


def read(scene: str) -> RawScene:
    """Raises `SceneError` where `mesh.ply` is missing or has no colours."""
    from hgs_core.scene.mesh_file import read_mesh_file

    given = Path(scene)
    folder = given if given.is_dir() else given.parent
    path = folder / _MESH
    if not path.is_file():
        found = ", ".join(sorted(child.name for child in folder.iterdir()))
        raise SceneError(
            f"{folder} holds no {_MESH} of Replica, only {found}: unpack all parts of the download again"
        )
    mesh, notices = read_mesh_file(path)
    if mesh.corner_colours is None:
        raise SceneError(
            f"{path} has no colours of vertices (red, green, blue): use the file that the download holds"
        )
    if (folder / "textures").is_dir():
        notices.append("colours are those of the vertices: the tiles in textures/ are not read")
    return RawScene(
        name=folder.resolve().name,
        mesh=mesh,
        known=SceneOptions(scale=1.0, up_axis="z"),
        notices=(f"Replica scene, z up, metres: {path.name}", *notices),
    )


SOURCE = SceneSource(
    opens="a Replica scene (apartment_0, ... with mesh.ply and semantic.json, textures/ or habitat/)",
    claims=claims,
    read=read,
)
