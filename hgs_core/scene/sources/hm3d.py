"""HM3D: a thousand Matterport scans, made for habitat.

Ramakrishnan et al., "Habitat-Matterport 3D Dataset (HM3D)", NeurIPS 2021. One folder a scan, `NNNNN-ID`, z up
and in metres, of which three downloads each hold another form of the mesh:

    00800-TEEsavR23oF/TEEsavR23oF.glb          hm3d-*-glb: JPEG textures
    00800-TEEsavR23oF/*.obj, .mtl, .jpg        hm3d-*-obj+mtl
    00800-TEEsavR23oF/TEEsavR23oF.basis.glb    hm3d-*-habitat: textures in a GPU format that is not read here
"""

from __future__ import annotations

import re
from pathlib import Path

from hgs_core.errors import SceneError
from hgs_core.scene.options import SceneOptions
from hgs_core.scene.source import RawScene, SceneSource

_FOLDER = re.compile(r"\d{5}-(?P<id>\w{11})")


def claims(scene: str) -> bool:
    path = Path(scene)
    if path.is_dir():
        return _scan_id(path) is not None
    in_scan = path.is_file() and _scan_id(path.parent) is not None
    return in_scan and path.suffix in (".glb", ".obj")


def read(scene: str) -> RawScene:
    """Raises `SceneError` where no form of the mesh can be read."""
    from hgs_core.scene.mesh_file import read_mesh_file

    given = Path(scene)
    folder = given if given.is_dir() else given.parent
    path = _mesh_in(folder) if given.is_dir() else given
    if path.name.endswith((".basis.glb", ".semantic.glb")):
        raise SceneError(
            f"{path} cannot serve: {_why_not(path)}. Put {_scan_id(folder)}.glb of the download hm3d-*-glb "
            "beside it"
        )
    mesh, notices = read_mesh_file(path)
    return RawScene(
        name=folder.resolve().name,
        mesh=mesh,
        known=SceneOptions(scale=1.0, up_axis="z"),
        notices=(f"HM3D scan, z up, metres: {path.name}", *notices),
    )


def _scan_id(folder: Path) -> str | None:
    match = _FOLDER.fullmatch(folder.resolve().name)
    return match["id"] if match else None


def _mesh_in(folder: Path) -> Path:
    glb = folder / f"{_scan_id(folder)}.glb"
    if glb.is_file():
        return glb
    objects = sorted(folder.glob("*.obj"))
    if len(objects) == 1:
        return objects[0]
    basis = glb.with_suffix(".basis.glb")
    if basis.is_file():
        return basis
    found = ", ".join(sorted(path.name for path in folder.iterdir())) or "nothing"
    raise SceneError(
        f"{folder} holds no mesh of HM3D: expected {glb.name} (download hm3d-*-glb) or one .obj with its "
        f".mtl and textures (hm3d-*-obj+mtl), found {found}"
    )


def _why_not(path: Path) -> str:
    if path.name.endswith(".basis.glb"):
        return "its textures are in the Basis format, for which there is no reader here"
    return "its colours are those of object labels"


SOURCE = SceneSource(
    opens="an HM3D scan (NNNNN-ID with ID.glb, or with an .obj, its .mtl and textures)",
    claims=claims,
    read=read,
)
