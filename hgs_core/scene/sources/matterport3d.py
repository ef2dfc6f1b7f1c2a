"""Matterport3D: the scans that HGS-Planner and most papers on active mapping are measured on.

Chang et al., "Matterport3D: Learning from RGB-D Data in Indoor Environments", 3DV 2017. Its owners' script
leaves two layouts, both z up and in metres:

    v1/scans/ID/matterport_mesh/HASH/HASH.obj    with .mtl and .jpg beside it (unpacked matterport_mesh.zip)
    mp3d/ID/ID.glb                               with ID.house, ID.navmesh, ID_semantic.ply (task habitat)

The zip unpacks into `ID/matterport_mesh/...`, so that unpacked in its own folder it lies one `ID/` deeper:
both are found.
"""

from __future__ import annotations

from pathlib import Path

from hgs_core.errors import SceneError
from hgs_core.scene.options import SceneOptions
from hgs_core.scene.source import RawScene, SceneSource

_MESH_FOLDER = "matterport_mesh"
_HABITAT_COMPANIONS = (".house", ".navmesh", "_semantic.ply")


def claims(scene: str) -> bool:
    path = Path(scene)
    return _is_scan(path) or _habitat_glb(path) is not None


def read(scene: str) -> RawScene:
    """Raises `SceneError` where the textured mesh is missing, still packed, or of an unreadable kind."""
    from hgs_core.scene.mesh_file import read_mesh_file

    folder = Path(scene)
    glb = _habitat_glb(folder)
    path = _scan_obj(folder) if glb is None else glb
    mesh, notices = read_mesh_file(path)
    return RawScene(
        name=glb.stem if glb is not None else folder.resolve().name,
        mesh=mesh,
        known=SceneOptions(scale=1.0, up_axis="z"),
        notices=(f"Matterport3D scan, z up, metres: {path.name}", *notices),
    )


def _is_scan(folder: Path) -> bool:
    return folder.is_dir() and any(
        (base / _MESH_FOLDER).is_dir() or (base / f"{_MESH_FOLDER}.zip").is_file() for base in _bases(folder)
    )


def _bases(folder: Path) -> tuple[Path, Path]:
    return folder, folder / folder.resolve().name


def _scan_obj(folder: Path) -> Path:
    meshes = sorted(obj for base in _bases(folder) for obj in (base / _MESH_FOLDER).glob("*/*.obj"))
    if len(meshes) == 1:
        return meshes[0]
    expected = f"{folder}/{_MESH_FOLDER}/HASH/HASH.obj with its .mtl and textures"
    if meshes:
        names = ", ".join(str(mesh.relative_to(folder)) for mesh in meshes)
        raise SceneError(f"{folder} holds several meshes ({names}): expected one, {expected}")
    packed = folder / f"{_MESH_FOLDER}.zip"
    remedy = f"unpack {packed.name} there" if packed.is_file() else "download it (--type matterport_mesh)"
    raise SceneError(f"{folder} holds no textured mesh of Matterport3D: expected {expected}; {remedy}")


def _habitat_glb(path: Path) -> Path | None:
    """The GLB of habitat's layout, from its folder or its own path."""
    glb = path / f"{path.resolve().name}.glb" if path.is_dir() else path
    if glb.suffix != ".glb" or not glb.is_file() or glb.resolve().parent.name != glb.stem:
        return None
    beside = (glb.parent / f"{glb.stem}{ending}" for ending in _HABITAT_COMPANIONS)
    return glb if any(companion.is_file() for companion in beside) else None


SOURCE = SceneSource(
    opens="a Matterport3D scan (v1/scans/ID with matterport_mesh/HASH/HASH.obj, or mp3d/ID with ID.glb and "
    "ID.house)",
    claims=claims,
    read=read,
)
