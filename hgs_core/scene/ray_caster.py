"""`RayCaster`: what can be seen of a mesh from where; pictures by a z-buffer, rays by Embree (open3d)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import open3d as o3d
from jaxtyping import Bool, Float, Float32, UInt8, UInt32
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.errors import SceneError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.scene.appearance import Appearance
from hgs_core.scene.textured_mesh import TexturedMesh

BACKGROUND_RGB = np.array([200, 215, 230], dtype=np.uint8)
"""Colour of rays that leave the world."""

_VISIBLE_TOLERANCE_M = 2e-3

_UNEVEN: Final = 32
"""Pixels whose neighbourhood of 3 x 3 spans more levels than this, of 255 in any channel, are looked at more
closely: borders of things, mostly, a sixth of the picture of a crowded room."""
_CENTRES: Final = np.zeros((1, 2), np.float32)
_CLOSER_LOOKS_PX: Final = np.array([[-1, -3], [3, -1], [1, 3], [-3, 1]], np.float32) / 8.0
"""Where in a pixel, from its centre: no two in one row or column, for upright and level borders."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfacesMet:
    """What looks of a camera meet first."""

    triangle: UInt32[ndarray, "looks pixels"]
    """0xFFFFFFFF where a look leaves the world."""
    barycentric: Float32[ndarray, "looks pixels 2"]
    """Weights of its corners 1 and 2."""
    z_depth_m: Float32[ndarray, "looks pixels"]
    facing: Float32[ndarray, "looks pixels"]
    """|n . d| of its unit normal and the look's direction (z = 1)."""


class RayCaster:
    """Rays against one mesh, which must not change. Results do not depend on the number of threads.

    Raises `SceneError` for a mesh without triangles.
    """

    def __init__(self, mesh: TexturedMesh) -> None:
        if len(mesh.triangles) == 0:
            raise SceneError("cannot cast rays: the mesh has no triangles")
        self.mesh = mesh
        self._vertices_m = np.ascontiguousarray(mesh.vertices_m, np.float32)
        self._triangles = np.ascontiguousarray(mesh.triangles, np.int32)
        self._embree = o3d.t.geometry.RaycastingScene()
        self._embree.add_triangles(
            o3d.core.Tensor.from_numpy(self._vertices_m),
            o3d.core.Tensor.from_numpy(self._triangles.astype(np.uint32)),
        )

    @cached_property
    def _appearance(self) -> Appearance:
        """Prepared at the first picture: many questions need rays alone."""
        return Appearance.of(self.mesh)

    def render(
        self, intrinsics: CameraIntrinsics, T_world_camera: SE3, range_m: float = np.inf
    ) -> tuple[UInt8[ndarray, "height width 3"], Float32[ndarray, "height width"]]:
        """Colours, and z-depths [m]: +inf beyond `range_m` (as z-depth) and where there is no surface.

        Colours reach further than depth, as a camera does; rays that leave the world get `BACKGROUND_RGB`. A
        colour is that of the pixel's area, not of one point of it: where the picture changes, five rays are
        averaged (textures are averaged by their pyramids). Depth is that of the pixel's centre.
        """
        met = self._first_surfaces(intrinsics, T_world_camera, _CENTRES, wanted=None)
        rgb, depth = self._shaded(met, intrinsics, range_m)
        rgb, depth = rgb[0].reshape(intrinsics.height, intrinsics.width, 3), depth[0]
        uneven = uneven_pixels(rgb)
        aside = self._first_surfaces(intrinsics, T_world_camera, _CLOSER_LOOKS_PX, wanted=uneven)
        total = self._shaded(aside, intrinsics, np.inf)[0].sum(axis=0, dtype=np.uint16) + rgb[uneven]
        looks = len(_CLOSER_LOOKS_PX) + 1
        rgb[uneven] = (total + looks // 2) // looks
        return rgb, depth.reshape(intrinsics.height, intrinsics.width)

    def cast(
        self, origins: Float[ndarray, "*rays 3"], directions: Float[ndarray, "*rays 3"]
    ) -> Float32[ndarray, "*rays"]:
        """Distance to the first surface in units of `|direction|` (m for unit vectors); +inf for none."""
        rays = np.concatenate(np.broadcast_arrays(origins, directions), axis=-1).astype(np.float32)
        hits = self._embree.cast_rays(o3d.core.Tensor.from_numpy(rays.reshape(-1, 6)))
        return hits["t_hit"].numpy().reshape(rays.shape[:-1])

    def distance_to_surface(self, points: Float[ndarray, "*points 3"]) -> Float32[ndarray, "*points"]:
        """Unsigned distance [m] from each point to the nearest triangle."""
        query = np.ascontiguousarray(points, dtype=np.float32).reshape(-1, 3)
        return (
            self._embree.compute_distance(o3d.core.Tensor.from_numpy(query))
            .numpy()
            .reshape(points.shape[:-1])
        )

    def visible(
        self, origins: Float[ndarray, "*#rays 3"], points: Float[ndarray, "*rays 3"]
    ) -> Bool[ndarray, "*rays"]:
        """Whether nothing stands between each origin and its point, the last 2 mm before the point aside.

        A point on a surface is so seen from either side of its face; at a shallow angle the 2 mm keep the
        surface from hiding its own point.
        """
        from_origin = np.asarray(points - origins, dtype=np.float64)
        distance = np.linalg.norm(from_origin, axis=-1, keepdims=True)
        shortened = from_origin * np.maximum(0.0, 1.0 - _VISIBLE_TOLERANCE_M / np.maximum(distance, 1e-9))
        rays = np.concatenate(np.broadcast_arrays(origins, shortened), axis=-1).astype(np.float32)
        occluded = self._embree.test_occlusions(
            o3d.core.Tensor.from_numpy(rays.reshape(-1, 6)), tnear=0.0, tfar=1.0
        )
        return np.logical_not(occluded.numpy()).reshape(rays.shape[:-1])

    def _first_surfaces(
        self,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        offsets_px: Float32[ndarray, "looks 2"],
        *,
        wanted: Bool[ndarray, "height width"] | None,
    ) -> SurfacesMet:
        """What each wanted pixel (all without a mask) shows at places in it, given from its centre."""
        pixels = intrinsics.width * intrinsics.height if wanted is None else int(np.count_nonzero(wanted))
        shape = (len(offsets_px), pixels)
        met = SurfacesMet(
            triangle=np.empty(shape, np.uint32),
            barycentric=np.empty((*shape, 2), np.float32),
            z_depth_m=np.empty(shape, np.float32),
            facing=np.empty(shape, np.float32),
        )
        kernels.first_surfaces(
            self._vertices_m,
            self._triangles,
            np.ascontiguousarray(T_world_camera.rotation, np.float64),
            np.ascontiguousarray(T_world_camera.translation, np.float64),
            intrinsics.width,
            intrinsics.height,
            intrinsics.fx,
            intrinsics.fy,
            intrinsics.cx,
            intrinsics.cy,
            offsets_px,
            wanted,
            met.triangle,
            met.barycentric,
            met.z_depth_m,
            met.facing,
        )
        return met

    def _shaded(
        self, met: SurfacesMet, intrinsics: CameraIntrinsics, range_m: float
    ) -> tuple[UInt8[ndarray, "looks pixels 3"], Float32[ndarray, "looks pixels"]]:
        """Colours, and z-depths up to the range."""
        look, pyramids = self._appearance, self._appearance.pyramids
        rgb = np.empty((*met.triangle.shape, 3), np.uint8)
        depth_m = np.empty(met.triangle.shape, np.float32)
        kernels.shade(
            met.triangle.reshape(-1),
            met.barycentric.reshape(-1, 2),
            met.z_depth_m.reshape(-1),
            met.facing.reshape(-1),
            look.uv,
            look.tint,
            look.texels_per_metre,
            look.texture,
            look.corner_rgb,
            pyramids.texels,
            pyramids.level_offset,
            pyramids.level_width,
            pyramids.level_height,
            pyramids.level_first,
            pyramids.level_count,
            focal_px=(intrinsics.fx * intrinsics.fy) ** 0.5,
            range_m=range_m,
            background=BACKGROUND_RGB,
            rgb=rgb.reshape(-1, 3),
            depth_m=depth_m.reshape(-1),
        )
        return rgb, depth_m


def uneven_pixels(rgb: UInt8[ndarray, "height width 3"]) -> Bool[ndarray, "height width"]:
    """Where a channel spans more than `_UNEVEN` within 3 x 3 pixels."""
    lightest = darkest = rgb
    for axis in (0, 1):
        lightest, darkest = _spread(lightest, np.maximum, axis), _spread(darkest, np.minimum, axis)
    return ((lightest - darkest) > _UNEVEN).any(axis=2)


def _spread(
    rgb: UInt8[ndarray, "height width 3"], choose: np.ufunc, axis: int
) -> UInt8[ndarray, "height width 3"]:
    """Each pixel's choice among itself and its two neighbours along an axis."""
    spread = rgb.copy()
    before, after = np.moveaxis(spread, axis, 0)[:-1], np.moveaxis(spread, axis, 0)[1:]
    choose(before, np.moveaxis(rgb, axis, 0)[1:], out=before)
    choose(after, np.moveaxis(rgb, axis, 0)[:-1], out=after)
    return spread
