"""A surface mesh from keyframes: truncated signed distances fused in a sparse volume.

Source: Curless and Levoy, "A volumetric method for building complex models from range images", 1996.
The volume is open3d's `VoxelBlockGrid`. It is filled tile by tile, so that memory follows the tile and never
the building; cells belong to exactly one tile and tiles share their border voxels, so that the surfaces of
neighbours meet vertex on vertex and are welded there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

import numpy as np
import open3d as o3d
from jaxtyping import Bool, Float, Float32, Int, Int32, UInt8
from numpy import ndarray
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.mapping.keyframes import TrainingImage

_BLOCK_VOXELS: Final = 8
_TILE_BLOCKS: Final = 50
"""Side of a tile, in blocks: 8 m with voxels of 2 cm."""
_FIRST_CAPACITY_BLOCKS: Final = 16_384
_STRIDE_PX: Final = 4
"""Step between the pixels that tell where a keyframe's surface lies."""
_CPU: Final = o3d.core.Device("CPU:0")


class MeshConfig(StrictConfig):
    """The surface mesh that is fused from the keyframes after a mission."""

    enabled: bool = True
    """Write `mesh.ply`."""
    voxel_size_m: float = Field(0.02, gt=0)
    """Edge of a voxel [m]: vertices are about as far apart."""
    truncation_voxels: float = Field(4.0, ge=1)
    """Depth counts for voxels this near to the measured surface, in voxels."""
    min_observations: int = Field(1, ge=1)
    """Voxels that fewer keyframes saw make no surface."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceMesh:
    """Triangles over shared vertices; a triangle's vertices run counter-clockwise seen from outside."""

    vertices_m: Float32[ndarray, "n_vertices 3"]
    triangles: Int32[ndarray, "n_triangles 3"]
    rgb: UInt8[ndarray, "n_vertices 3"]


@runtime_checkable
class ImageSource(Protocol):
    """Posed depth images that are loaded one at a time: a `KeyframeArchive`, say."""

    def __len__(self) -> int: ...

    def load_halved(self, index: int) -> TrainingImage: ...


def fuse_mesh(
    images: ImageSource, config: MeshConfig, *, progress: Callable[[str], None] | None = None
) -> SurfaceMesh:
    """The surface that the images' depth shows, coloured. Empty when no image has a depth.

    Deterministic. Every image is loaded once to learn where its surface lies, and once for each tile of
    `_TILE_BLOCKS` blocks that it reaches.
    """
    tile_m = _TILE_BLOCKS * _BLOCK_VOXELS * config.voxel_size_m
    margin_m = (config.truncation_voxels + 1.0) * config.voxel_size_m
    reach = [_extent(images.load_halved(index), margin_m) for index in range(len(images))]
    tiles = _tiles(reach, tile_m)
    parts = []
    for number, tile in enumerate(tiles):
        if progress is not None:
            progress(f"mesh: tile {number + 1} of {len(tiles)}")
        lower, upper = np.array(tile) * tile_m, (np.array(tile) + 1) * tile_m
        chosen = [
            index
            for index, extent in enumerate(reach)
            if extent is not None and np.all(extent[1] >= lower) and np.all(extent[0] <= upper)
        ]
        parts.append(_fuse_tile(images, chosen, np.array(tile), config))
    return _welded(parts)


def _extent(
    image: TrainingImage, margin_m: float
) -> tuple[Float[ndarray, " 2"], Float[ndarray, " 2"]] | None:
    """Lower and upper x and y of an image's surface, widened by `margin_m`; None without a depth."""
    depth = np.where(image.measured, image.depth_m, 0.0)[::_STRIDE_PX, ::_STRIDE_PX]
    rays = image.intrinsics.rays()[::_STRIDE_PX, ::_STRIDE_PX]
    points = image.T_world_camera.apply((rays * depth[..., None])[depth > 0])[:, :2]
    if len(points) == 0:
        return None
    # What lies between two of the pixels looked at may reach out by their distance.
    beyond = margin_m + _STRIDE_PX * float(depth.max()) / image.intrinsics.fx
    return points.min(axis=0) - beyond, points.max(axis=0) + beyond


def _tiles(
    reach: list[tuple[Float[ndarray, " 2"], Float[ndarray, " 2"]] | None], tile_m: float
) -> list[tuple[int, int]]:
    """Indices of the tiles that any image reaches, in order."""
    tiles: set[tuple[int, int]] = set()
    for extent in reach:
        if extent is not None:
            first, last = (np.floor(corner / tile_m).astype(int) for corner in extent)
            tiles.update((x, y) for x in range(first[0], last[0] + 1) for y in range(first[1], last[1] + 1))
    return sorted(tiles)


def _fuse_tile(
    images: ImageSource, chosen: list[int], tile: Int[ndarray, " 2"], config: MeshConfig
) -> SurfaceMesh:
    volume = o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight", "color"),
        (o3d.core.float32, o3d.core.uint16, o3d.core.uint16),
        tuple(o3d.core.SizeVector([channels]) for channels in (1, 1, 3)),
        config.voxel_size_m,
        _BLOCK_VOXELS,
        _FIRST_CAPACITY_BLOCKS,
        _CPU,
    )
    first, last = tile * _TILE_BLOCKS, (tile + 1) * _TILE_BLOCKS
    empty = True
    for index in chosen:
        empty &= not _integrate(volume, images.load_halved(index), first, last, config)
    if empty:
        return _empty_mesh()
    # open3d keeps voxels that were seen more often than its threshold.
    mesh = volume.extract_triangle_mesh(config.min_observations - 0.5)
    if len(mesh.triangle.indices) == 0:
        return _empty_mesh()
    vertices: Float32[ndarray, "n 3"] = mesh.vertex.positions.numpy().astype(np.float32)
    triangles: Int32[ndarray, "m 3"] = mesh.triangle.indices.numpy().astype(np.int32)
    rgb: UInt8[ndarray, "n 3"] = np.clip(mesh.vertex.colors.numpy() * 255.0 + 0.5, 0, 255).astype(np.uint8)
    # A triangle lies within one cell, and a cell belongs to the tile that its centre is in.
    cells = np.floor(vertices[triangles][..., :2].astype(float).mean(axis=1) / config.voxel_size_m)
    blocks = np.floor(cells / _BLOCK_VOXELS)
    return _compact(vertices, triangles[np.all((blocks >= first) & (blocks < last), axis=1)], rgb)


def _integrate(
    volume: o3d.t.geometry.VoxelBlockGrid,
    image: TrainingImage,
    first: Int[ndarray, " 2"],
    last: Int[ndarray, " 2"],
    config: MeshConfig,
) -> bool:
    """Add one image to the blocks of a tile and the ring around it; whether it reached any."""
    camera = image.intrinsics
    # open3d projects to pixel indices by rounding down, which suits pixel centres at integer + 0.5.
    matrix = o3d.core.Tensor.from_numpy(
        np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    )
    world_to_camera = o3d.core.Tensor.from_numpy(image.T_world_camera.inverse().as_matrix())
    measured = np.where(image.measured, image.depth_m, np.float32(0.0))
    if not measured.any():
        return False
    depth = o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(measured))
    reach = (1.0, float(measured.max()) + 1.0, config.truncation_voxels)
    blocks = volume.compute_unique_block_coordinates(depth, matrix, world_to_camera, *reach).numpy()
    inside = np.all((blocks[:, :2] >= first - 1) & (blocks[:, :2] <= last), axis=1)
    if not inside.any():
        return False
    chosen = o3d.core.Tensor.from_numpy(np.ascontiguousarray(blocks[inside]))
    rgb = image.rgb.astype(np.float32) / np.float32(255.0)
    colour = o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(rgb))
    volume.integrate(chosen, depth, colour, matrix, world_to_camera, *reach)
    return True


def _welded(parts: list[SurfaceMesh]) -> SurfaceMesh:
    """All parts as one mesh, in which equal vertices are one."""
    if not parts:
        return _empty_mesh()
    if len(parts) == 1:
        return parts[0]
    offsets = np.cumsum([0, *(len(part.vertices_m) for part in parts)])
    triangles = np.concatenate(
        [part.triangles + np.int32(offset) for part, offset in zip(parts, offsets, strict=False)]
    )
    vertices = np.concatenate([part.vertices_m for part in parts])
    _, kept, place = np.unique(
        np.round(vertices, 6).view(np.dtype((np.void, 12))).ravel(), return_index=True, return_inverse=True
    )
    rgb = np.concatenate([part.rgb for part in parts])
    return _compact(vertices, kept[place.ravel()[triangles]].astype(np.int32), rgb)


def _compact(
    vertices: Float32[ndarray, "n 3"], triangles: Int32[ndarray, "m 3"], rgb: UInt8[ndarray, "n 3"]
) -> SurfaceMesh:
    """The mesh without vertices that no triangle uses."""
    used: Bool[ndarray, " n"] = np.zeros(len(vertices), bool)
    used[triangles] = True
    place = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return SurfaceMesh(vertices_m=vertices[used], triangles=place[triangles], rgb=rgb[used])


def _empty_mesh() -> SurfaceMesh:
    return SurfaceMesh(
        vertices_m=np.zeros((0, 3), np.float32),
        triangles=np.zeros((0, 3), np.int32),
        rgb=np.zeros((0, 3), np.uint8),
    )
