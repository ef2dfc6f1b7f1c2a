"""Layer: the surface mesh of a mission that has ended, from its `mesh.ply`.

Fusing a mesh takes longer than a mission may be kept waiting, so a mission that runs has none: its surfaces
are the Gaussians and the voxels. The finished mesh is shown at a bounded number of triangles.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, Final

import numpy as np
import viser
from jaxtyping import Float32, Int32, UInt8
from numpy import ndarray

from app.missions.display import DisplayView
from hgs_core.errors import MapError

log = logging.getLogger(__name__)

MAX_TRIANGLES: Final = 250_000
_CELLS_M: Final = (0.03, 0.04, 0.06, 0.08, 0.12, 0.16, 0.24, 0.32, 0.5, 1.0)


class MeshLayer:
    """Read when it is first looked at, once."""

    title = "Mesh (finished missions)"
    shown_at_first = False

    def __init__(self, server: viser.ViserServer, file: Path | None) -> None:
        self._server = server
        self._file = file
        self._node: Any = None

    def update(self, view: DisplayView) -> None:
        """A finished mesh stays as it is."""

    def set_visible(self, visible: bool) -> None:
        if visible and self._node is None and self._file is not None and self._file.is_file():
            self._read(self._file)
        if self._node is not None:
            self._node.visible = visible

    def _read(self, file: Path) -> None:
        import trimesh

        from hgs_core.mapping.mesh_file import read_mesh

        try:
            mesh = read_mesh(file)
        except MapError as error:
            log.warning("the mesh cannot be shown: %s", error)
            return
        vertices, triangles, rgb = coarse(mesh.vertices_m, mesh.triangles, mesh.rgb)
        alpha = np.full((len(rgb), 1), 255, np.uint8)
        shown = trimesh.Trimesh(
            vertices, triangles, vertex_colors=np.concatenate([rgb, alpha], axis=1), process=False
        )
        self._node = self._server.scene.add_mesh_trimesh(
            "/mesh", shown, cast_shadow=False, receive_shadow=False
        )


def coarse(
    vertices_m: Float32[ndarray, "n 3"], triangles: Int32[ndarray, "m 3"], rgb: UInt8[ndarray, "n 3"]
) -> tuple[Float32[ndarray, "n2 3"], Int32[ndarray, "m2 3"], UInt8[ndarray, "n2 3"]]:
    """The mesh with the vertices of each cell of a grid drawn together: as coarse as `MAX_TRIANGLES` asks."""
    for cell_m in _CELLS_M:
        if len(triangles) <= MAX_TRIANGLES:
            break
        cells = np.floor(vertices_m / cell_m).astype(np.int64)
        _, own, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        own = own.ravel()
        means = [
            np.stack([np.bincount(own, values[:, axis]) for axis in range(3)], axis=1) / counts[:, None]
            for values in (vertices_m, rgb)
        ]
        vertices_m, rgb = means[0].astype(np.float32), means[1].astype(np.uint8)
        triangles = own[triangles].astype(np.int32)
        a, b, c = triangles.T
        triangles = np.unique(triangles[(a != b) & (b != c) & (a != c)], axis=0)
    return vertices_m, triangles, rgb
