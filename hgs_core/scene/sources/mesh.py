"""Any textured mesh: a GLB, glTF, OBJ or PLY file, and the JSON beside it that may name a start."""

from __future__ import annotations

import json
from pathlib import Path

from hgs_core.scene.mesh_suffixes import MESH_SUFFIXES
from hgs_core.scene.options import SceneOptions, StartOptions
from hgs_core.scene.source import RawScene, SceneSource

_GLTF_SUFFIXES = (".glb", ".gltf")


def claims(scene: str) -> bool:
    path = Path(scene)
    return path.suffix.lower() in MESH_SUFFIXES and not path.is_dir()


def read(scene: str) -> RawScene:
    """Raises `SceneError` for a file that is missing, unreadable or without triangles."""
    from hgs_core.scene.mesh_file import read_mesh_file

    path = Path(scene)
    mesh, notices = read_mesh_file(path)
    start = _start_beside(path, notices)
    up_axis = "y" if path.suffix.lower() in _GLTF_SUFFIXES else None
    known = SceneOptions(up_axis=up_axis, start=start)
    return RawScene(name=path.stem, mesh=mesh, known=known, notices=tuple(notices))


def _start_beside(path: Path, notices: list[str]) -> StartOptions | None:
    sidecar = path.with_suffix(".json")
    if not sidecar.is_file():
        return None
    try:
        start = json.loads(sidecar.read_text(encoding="utf-8"))["start"]
        x, y = (float(value) for value in start["xyz"][:2])
        return StartOptions(x_m=x, y_m=y, yaw_deg=float(start["yaw_deg"]))
    except (KeyError, TypeError, ValueError) as error:
        notices.append(f"{sidecar.name} gives no usable start ({error!r}): a start is chosen")
        return None


SOURCE = SceneSource(
    opens=f"a textured mesh ({', '.join(MESH_SUFFIXES)})", claims=claims, read=read, general=True
)
