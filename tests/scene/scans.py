"""Small scans with the folders, file names and formats of those that their owners give out."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image

from hgs_core.scene.textured_mesh import TexturedMesh
from tests.scene.worlds import textured, y_up

HASH = "bed1a77d92d64f5cbbaaae4feed64ec1"
WALLS = {
    "floor": ([(0, 0, 0), (5, 0, 0), (5, 4, 0), (0, 4, 0)], (90, 70, 60)),
    "ceiling": ([(0, 0, 2.5), (0, 4, 2.5), (5, 4, 2.5), (5, 0, 2.5)], (240, 240, 240)),
    "south": ([(0, 0, 0), (0, 0, 2.5), (5, 0, 2.5), (5, 0, 0)], (200, 40, 40)),
    "north": ([(0, 4, 0), (5, 4, 0), (5, 4, 2.5), (0, 4, 2.5)], (40, 200, 40)),
    "west": ([(0, 0, 0), (0, 4, 0), (0, 4, 2.5), (0, 0, 2.5)], (40, 40, 200)),
    "east": ([(5, 0, 0), (5, 0, 2.5), (5, 4, 2.5), (5, 4, 0)], (200, 200, 40)),
}
"""A room of quads, z up, each wall with a colour of its own."""


def write_obj(path: Path, *, textures: bool = True) -> None:
    """The room as an OBJ of quads and one pentagon, its .mtl, and a JPEG a wall."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines, library, first = [f"mtllib {path.stem}.mtl"], [], 1
    for number, (name, (corners, colour)) in enumerate(WALLS.items()):
        image = f"{path.stem}_{number:03d}.jpg"
        library += [f"newmtl {name}", "Kd 1 1 1", f"map_Kd {image}"]
        if textures:
            Image.new("RGB", (16, 16), colour).save(path.parent / image)
        # A corner more on the floor's first edge makes it a pentagon.
        points = [corners[0], (2.5, 0, 0), *corners[1:]] if name == "floor" else corners
        lines += [f"v {x} {y} {z}" for x, y, z in points]
        bottom = [(0, 0), (0.5, 0), (1, 0)] if name == "floor" else [(0, 0), (1, 0)]
        lines += [f"vt {u} {v}" for u, v in [*bottom, (1, 1), (0, 1)]]
        lines += [f"usemtl {name}", "f " + " ".join(f"{first + i}/{first + i}" for i in range(len(points)))]
        first += len(points)
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".mtl").write_text("\n".join(library) + "\n")


def matterport3d(root: Path, scan: str = "17DRP5sb8fy") -> Path:
    folder = root / "v1" / "scans" / scan
    write_obj(folder / "matterport_mesh" / HASH / f"{HASH}.obj")
    (folder / "house_segmentations").mkdir()
    (folder / "undistorted_color_images.zip").write_bytes(b"PK")
    return folder


def write_glb(path: Path, mesh: TexturedMesh, *, z_up: bool, basis: bool = False) -> None:
    """A textured GLB; with `z_up` the vertices stay as they are, against glTF's standard."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = textured(mesh)
    (plain if z_up else y_up(plain)).export(path)
    if basis:
        _with_basis_textures(path)


def _with_basis_textures(path: Path) -> None:
    """Changes the GLB's header as the Basis compressor does."""
    content = path.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    document = json.loads(content[20 : 20 + length])
    for image in document["images"]:
        image["mimeType"] = "image/x-basis"
    for texture in document["textures"]:
        texture["extensions"] = {"GOOGLE_texture_basis": {"source": texture.pop("source")}}
    document["extensionsUsed"] = document["extensionsRequired"] = ["GOOGLE_texture_basis"]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + content[20 + length :]
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def habitat_matterport3d(root: Path, mesh: TexturedMesh, *, basis: bool, scan: str = "2t7WUuJeko7") -> Path:
    folder = root / "mp3d" / scan
    write_glb(folder / f"{scan}.glb", mesh, z_up=True, basis=basis)
    for ending in (".house", ".navmesh", "_semantic.ply"):
        (folder / f"{scan}{ending}").write_bytes(b"")
    return folder


def hm3d(root: Path, mesh: TexturedMesh, *, forms: tuple[str, ...]) -> Path:
    """`forms`: of `glb`, `basis.glb`, `semantic.glb` and `obj`."""
    folder = root / "hm3d" / "minival" / "00800-TEEsavR23oF"
    folder.mkdir(parents=True)
    for form in forms:
        if form == "obj":
            write_obj(folder / "TEEsavR23oF.obj")
        else:
            write_glb(folder / f"TEEsavR23oF.{form}", mesh, z_up=True, basis=form == "basis.glb")
    return folder


def write_quad_ply(path: Path, *, step_m: float = 0.25, colours: bool = True, mixed: bool = False) -> None:
    """The room as binary quads with colours of vertices; `mixed` cuts every third quad into triangles."""
    path.parent.mkdir(parents=True, exist_ok=True)
    vertices, faces = [], []
    for corners, colour in WALLS.values():
        a, b, _, d = np.array(corners, dtype=float)
        nu, nv = (round(float(np.linalg.norm(side)) / step_m) for side in (b - a, d - a))
        index = len(vertices) + np.arange((nu + 1) * (nv + 1)).reshape(nu + 1, nv + 1)
        for i in range(nu + 1):
            for j in range(nv + 1):
                point = a + (b - a) * i / nu + (d - a) * j / nv
                tail = struct.pack("<3B", *colour) if colours else b""
                vertices.append(struct.pack("<6f", *point, 0, 0, 1) + tail)
        for i in range(nu):
            for j in range(nv):
                quad = [index[i, j], index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]]
                cut = [quad[:3], [quad[0], *quad[2:]]] if mixed and len(faces) % 3 == 0 else [quad]
                faces += [struct.pack(f"<B{len(polygon)}i", len(polygon), *polygon) for polygon in cut]
    names = ["x", "y", "z", "nx", "ny", "nz"]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"property uchar {name}" for name in ("red", "green", "blue")] if colours else []
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    path.write_bytes("\n".join(header).encode() + b"".join(vertices) + b"".join(faces))


def replica(root: Path, *, colours: bool = True) -> Path:
    folder = root / "replica_v1" / "apartment_0"
    write_quad_ply(folder / "mesh.ply", colours=colours)
    (folder / "textures").mkdir()
    (folder / "textures" / "0-color-ptex.hdr").write_bytes(b"")
    (folder / "textures" / "parameters.json").write_text('{"splitSize": 0.5, "tileSize": 16}')
    (folder / "habitat").mkdir()
    for name in ("semantic.json", "preseg.json", "glass.sur", "habitat/info_semantic.json"):
        (folder / name).write_text("{}")
    return folder
