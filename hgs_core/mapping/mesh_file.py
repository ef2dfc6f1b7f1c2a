"""`mesh.ply`: a triangle mesh with coloured vertices, binary little endian, float32 positions [m]."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import numpy as np
import open3d as o3d

from hgs_core.errors import MapError
from hgs_core.mapping.volume_fusion import SurfaceMesh

_VERTEX: Final = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
_FACE: Final = np.dtype([("n", "u1"), ("indices", "<i4", 3)])


def write_mesh(mesh: SurfaceMesh, path: Path) -> None:
    """Write `path` whole or not at all (temporary file beside it, then rename)."""
    vertices = np.empty(len(mesh.vertices_m), _VERTEX)
    vertices["xyz"], vertices["rgb"] = mesh.vertices_m, mesh.rgb
    faces = np.empty(len(mesh.triangles), _FACE)
    faces["n"], faces["indices"] = 3, mesh.triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in ("red", "green", "blue")),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    with partial.open("wb") as file:
        file.write(("\n".join(header) + "\n").encode("ascii"))
        vertices.tofile(file)
        faces.tofile(file)
    partial.replace(path)


def read_mesh(path: Path) -> SurfaceMesh:
    """Raises `MapError` for a file that is missing or no triangle mesh with coloured vertices."""
    if not path.is_file():
        raise MapError(f"{path} is missing: `hgs mesh` makes it")
    content = o3d.io.read_triangle_mesh(path)
    if not content.has_triangles() or not content.has_vertex_colors():
        raise MapError(f"{path} is not a triangle mesh with coloured vertices")
    return SurfaceMesh(
        vertices_m=np.asarray(content.vertices).astype(np.float32),
        triangles=np.asarray(content.triangles).astype(np.int32),
        rgb=np.rint(np.asarray(content.vertex_colors) * 255.0).astype(np.uint8),
    )
