"""How triangles look, prepared once for the shading kernel: texture pyramids and baked light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int32, Int64, UInt8
from numpy import ndarray
from PIL import Image

from hgs_core.scene.textured_mesh import TexturedMesh

AMBIENT = 0.38
_LIGHT_DIRECTIONS = np.array([[0.30, 0.20, 0.933], [0.88, -0.40, 0.25], [-0.38, 0.88, 0.28]])
_LIGHT_COLOURS = np.array([[0.42, 0.41, 0.39], [0.30, 0.30, 0.31], [0.17, 0.175, 0.19]])


def fixed_light(normals: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    """Light on surfaces with unit `normals`: ambient plus three fixed directions.

    Each direction contributes by |cosine|, so both sides of a face are lit alike and a surface has one
    colour from wherever it is seen.
    """
    cosines = np.abs(normals @ (_LIGHT_DIRECTIONS / np.linalg.norm(_LIGHT_DIRECTIONS, axis=1)[:, None]).T)
    return AMBIENT + cosines @ _LIGHT_COLOURS


@dataclass(frozen=True, kw_only=True, eq=False)
class TexturePyramids:
    """All textures with their half, quarter, ... sizes down to one texel, in one array."""

    texels: UInt8[ndarray, "n_texels 3"]
    level_offset: Int64[ndarray, " n_levels"]
    level_width: Int32[ndarray, " n_levels"]
    level_height: Int32[ndarray, " n_levels"]
    level_first: Int32[ndarray, " n_textures"]
    level_count: Int32[ndarray, " n_textures"]

    @staticmethod
    def of(textures: list[UInt8[ndarray, "_h _w 3"]]) -> TexturePyramids:
        chunks: list[UInt8[ndarray, "n 3"]] = []
        offset: list[int] = []
        width: list[int] = []
        height: list[int] = []
        first: list[int] = []
        count: list[int] = []
        total = 0
        for texture in textures:
            first.append(len(offset))
            level = texture
            while True:
                chunks.append(np.ascontiguousarray(level).reshape(-1, 3))
                offset.append(total)
                height.append(level.shape[0])
                width.append(level.shape[1])
                total += level.shape[0] * level.shape[1]
                if level.shape[0] == level.shape[1] == 1:
                    break
                level = _halved(level)
            count.append(len(offset) - first[-1])
        return TexturePyramids(
            texels=np.concatenate(chunks) if chunks else np.zeros((0, 3), dtype=np.uint8),
            level_offset=np.array(offset, dtype=np.int64),
            level_width=np.array(width, dtype=np.int32),
            level_height=np.array(height, dtype=np.int32),
            level_first=np.array(first, dtype=np.int32),
            level_count=np.array(count, dtype=np.int32),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Appearance:
    """Per-triangle inputs of the shading kernel."""

    uv: Float32[ndarray, "n 3 2"]
    tint: Float32[ndarray, "n 3"]
    texels_per_metre: Float32[ndarray, " n"]
    texture: Int32[ndarray, " n"]
    corner_rgb: UInt8[ndarray, "n 3 3"] | None
    pyramids: TexturePyramids

    @staticmethod
    def of(mesh: TexturedMesh) -> Appearance:
        textures: list[UInt8[ndarray, "h w 3"]] = []
        number_of: dict[int, int] = {}
        texture_of_material = []
        for material in mesh.materials:
            if material.texture is None:
                texture_of_material.append(-1)
                continue
            if id(material.texture) not in number_of:
                number_of[id(material.texture)] = len(textures)
                textures.append(material.texture)
            texture_of_material.append(number_of[id(material.texture)])
        texture = np.array(texture_of_material, dtype=np.int32)[mesh.material_index]
        factor = np.array([material.factor for material in mesh.materials])[mesh.material_index]
        normals = mesh.normals
        return Appearance(
            uv=np.ascontiguousarray(mesh.uv),
            tint=(fixed_light(normals.astype(np.float64)) * factor).astype(np.float32),
            texels_per_metre=_texels_per_metre(mesh, texture, textures),
            texture=texture,
            corner_rgb=None if mesh.corner_colours is None else np.ascontiguousarray(mesh.corner_colours),
            pyramids=TexturePyramids.of(textures),
        )


def _halved(level: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h2 w2 3"]:
    size = (max(1, level.shape[1] // 2), max(1, level.shape[0] // 2))
    return np.asarray(Image.fromarray(level).resize(size, Image.Resampling.BOX))


def _texels_per_metre(
    mesh: TexturedMesh, texture: Int32[ndarray, " n"], textures: list[UInt8[ndarray, "_h _w 3"]]
) -> Float32[ndarray, " n"]:
    """Square root of texels per square metre; 0 where nothing is textured or the triangle has no area."""
    sizes = np.array([t.shape[0] * t.shape[1] for t in textures] + [0], dtype=np.float64)
    edges = (mesh.uv[:, 1:] - mesh.uv[:, :1]).astype(np.float64)
    uv_area = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]) / 2
    area = mesh.areas_m2
    density = np.divide(uv_area * sizes[texture], area, out=np.zeros_like(area), where=area > 1e-12)
    return np.sqrt(density).astype(np.float32)
