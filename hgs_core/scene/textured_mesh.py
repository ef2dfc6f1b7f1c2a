"""Triangles with textures: the ground truth that simulation and evaluation look at."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32, UInt8
from numpy import ndarray

from hgs_core.errors import SceneError
from hgs_core.geometry.boxes import Box


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """What a triangle is painted with: `factor` times the texture (or times white without one)."""

    name: str
    factor: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Display (sRGB) colour, each component in [0, 1]."""
    texture: UInt8[ndarray, "height width 3"] | None = None
    """sRGB texels; row 0 is the top, texture coordinates repeat outside [0, 1)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TexturedMesh:
    """Triangles in the world frame [m]; colour = material factor x texture x corner colour.

    Texture coordinate (0, 0) is the lower left corner of the texture, as in OBJ and OpenGL. Raises
    `SceneError` when arrays disagree or an index points nowhere.
    """

    vertices_m: Float32[ndarray, "n_vertices 3"]
    triangles: Int32[ndarray, "n_triangles 3"]
    uv: Float32[ndarray, "n_triangles 3 2"]
    """Texture coordinates of each triangle's corners."""
    material_index: Int32[ndarray, " n_triangles"]
    materials: tuple[Material, ...]
    corner_colours: UInt8[ndarray, "n_triangles 3 3"] | None = None

    def __post_init__(self) -> None:
        n = len(self.triangles)
        if self.uv.shape[0] != n or self.material_index.shape[0] != n:
            raise SceneError(
                f"mesh has {n} triangles but {len(self.uv)} texture "
                f"and {len(self.material_index)} material entries"
            )
        if self.corner_colours is not None and len(self.corner_colours) != n:
            raise SceneError(f"mesh has {n} triangles but {len(self.corner_colours)} corner colours")
        if n and not (self.triangles.min() >= 0 and self.triangles.max() < len(self.vertices_m)):
            raise SceneError(f"triangles index vertices outside 0..{len(self.vertices_m) - 1}")
        if n and not (self.material_index.min() >= 0 and self.material_index.max() < len(self.materials)):
            raise SceneError(f"triangles name materials outside 0..{len(self.materials) - 1}")

    @property
    def corners_m(self) -> Float32[ndarray, "n_triangles 3 3"]:
        return self.vertices_m[self.triangles]

    @property
    def normals(self) -> Float32[ndarray, "n_triangles 3"]:
        """Unit geometric normals by the right-hand rule; zero for triangles without area."""
        cross = self._double_area_normals
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return np.divide(cross, length, out=np.zeros_like(cross), where=length > 0).astype(np.float32)

    @property
    def areas_m2(self) -> Float[ndarray, " n_triangles"]:
        return np.linalg.norm(self._double_area_normals, axis=1) / 2

    @property
    def _double_area_normals(self) -> Float[ndarray, "n_triangles 3"]:
        corners = self.corners_m.astype(np.float64)
        return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])

    def bounds(self) -> Box:
        """The smallest box around all triangles, 1 mm wider on every side so that it holds them."""
        used = self.vertices_m[np.unique(self.triangles)].astype(np.float64)
        return Box(lower_m=used.min(axis=0) - 1e-3, upper_m=used.max(axis=0) + 1e-3)

    def kept(self, keep: Bool[ndarray, " n_triangles"]) -> TexturedMesh:
        """The mesh of the triangles where `keep`; vertices that no triangle uses are dropped."""
        triangles = self.triangles[keep]
        used, compact = np.unique(triangles, return_inverse=True)
        return replace(
            self,
            vertices_m=self.vertices_m[used],
            triangles=compact.reshape(-1, 3).astype(np.int32),
            uv=self.uv[keep],
            material_index=self.material_index[keep],
            corner_colours=None if self.corner_colours is None else self.corner_colours[keep],
        )

    def moved(
        self, rotation: Float[ndarray, "3 3"], translation_m: Float[ndarray, " 3"], scale: float = 1.0
    ) -> TexturedMesh:
        """The mesh with every vertex at `scale * rotation @ vertex + translation_m`."""
        vertices = scale * (self.vertices_m.astype(np.float64) @ rotation.T) + translation_m
        return replace(self, vertices_m=vertices.astype(np.float32))

    def sample_surface(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float[ndarray, "count 3"], Int[ndarray, " count"]]:
        """`count` points drawn uniformly by area, and the triangle that each lies on."""
        areas = self.areas_m2
        chosen = rng.choice(len(areas), size=count, p=areas / areas.sum())
        # Square root warping makes the density uniform over each triangle.
        root, along = np.sqrt(rng.random(count)), rng.random(count)
        weights = np.stack([1 - root, root * (1 - along), root * along], axis=1)
        points = np.einsum("nk,nkd->nd", weights, self.corners_m[chosen].astype(np.float64))
        return points, chosen


def concatenated(parts: list[TexturedMesh]) -> TexturedMesh:
    """All `parts` as one mesh; materials are kept apart."""
    if not parts:
        raise SceneError("no mesh to join: the scene is empty")
    vertex_base = np.cumsum([0] + [len(part.vertices_m) for part in parts])
    material_base = np.cumsum([0] + [len(part.materials) for part in parts])
    coloured = any(part.corner_colours is not None for part in parts)
    return TexturedMesh(
        vertices_m=np.concatenate([part.vertices_m for part in parts]),
        triangles=np.concatenate(
            [part.triangles + base for part, base in zip(parts, vertex_base, strict=False)]
        ).astype(np.int32),
        uv=np.concatenate([part.uv for part in parts]),
        material_index=np.concatenate(
            [part.material_index + base for part, base in zip(parts, material_base, strict=False)]
        ).astype(np.int32),
        materials=tuple(material for part in parts for material in part.materials),
        corner_colours=np.concatenate(
            [
                np.full((len(part.triangles), 3, 3), 255, dtype=np.uint8)
                if part.corner_colours is None
                else part.corner_colours
                for part in parts
            ]
        )
        if coloured
        else None,
    )
