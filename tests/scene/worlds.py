"""Small worlds made by hand."""

from __future__ import annotations

import numpy as np
import trimesh
from PIL import Image

from hgs_core.scene.textured_mesh import Material, TexturedMesh, concatenated

CHECKER = np.kron(
    np.array([[[220, 60, 40], [40, 60, 220]], [[40, 200, 60], [240, 230, 90]]], dtype=np.uint8),
    np.ones((16, 16, 1), dtype=np.uint8),
)
"""32 x 32: red and blue above green and yellow."""


def quad(corners: list[tuple[float, float, float]], texture: np.ndarray | None = None) -> TexturedMesh:
    """Corners lower left, lower right, upper right, upper left."""
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return TexturedMesh(
        vertices_m=np.array(corners, dtype=np.float32),
        triangles=triangles,
        uv=uv[triangles],
        material_index=np.zeros(2, dtype=np.int32),
        materials=(Material(name="quad", texture=texture),),
    )


def box(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> TexturedMesh:
    """A closed cuboid."""
    (x0, y0, z0), (x1, y1, z1) = lower, upper
    return concatenated(
        [
            quad([(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0)], CHECKER),
            quad([(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)], CHECKER),
            quad([(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)], CHECKER),
            quad([(x0, y1, z0), (x1, y1, z0), (x1, y1, z1), (x0, y1, z1)], CHECKER),
            quad([(x0, y0, z0), (x0, y1, z0), (x0, y1, z1), (x0, y0, z1)], CHECKER),
            quad([(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)], CHECKER),
        ]
    )


def room(
    x: tuple[float, float] = (-3.0, 3.0), y: tuple[float, float] = (-2.0, 2.0), height: float = 2.5
) -> TexturedMesh:
    """An empty closed room with its floor at z = 0."""
    return box((x[0], y[0], 0.0), (x[1], y[1], height))


def with_boxes(
    *boxes: tuple[tuple[float, float, float], tuple[float, float, float]],
) -> TexturedMesh:
    """The default room with cuboids in it."""
    return concatenated([room(), *(box(lower, upper) for lower, upper in boxes)])


def tessellated(mesh: TexturedMesh) -> trimesh.Trimesh:
    """The mesh for export, in its own axes, in triangles of at most 0.3 m."""
    plain = trimesh.Trimesh(vertices=mesh.vertices_m, faces=mesh.triangles, process=False)
    return plain.subdivide_to_size(0.3)


def textured(mesh: TexturedMesh) -> trimesh.Trimesh:
    """The mesh for export with one texture, each corner a vertex of its own."""
    corners = mesh.corners_m.reshape(-1, 3)
    material = trimesh.visual.material.PBRMaterial(
        name="checker", baseColorTexture=Image.fromarray(CHECKER), baseColorFactor=[255, 255, 255, 255]
    )
    return trimesh.Trimesh(
        vertices=corners,
        faces=np.arange(len(corners)).reshape(-1, 3),
        visual=trimesh.visual.TextureVisuals(uv=mesh.uv.reshape(-1, 2), material=material),
        process=False,
    )


def y_up(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A copy turned from z up to y up: world (x, y, z) becomes (x, z, -y)."""
    turned = mesh.copy()
    turned.vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    return turned
