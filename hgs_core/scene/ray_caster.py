"""`RayCaster`: what can be seen of a mesh from where (Embree through open3d; shading in C++)."""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np
import open3d as o3d
from jaxtyping import Bool, Float, Float32, UInt8
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
_CLOSER_LOOKS_PX: Final = np.array([[-1, -3], [3, -1], [1, 3], [-3, 1]], np.float32) / 8.0
"""Where in a pixel, from its centre: no two in one row or column, for upright and level borders."""
_RAYS_AT_ONCE: Final = 1 << 14
"""open3d keeps the interpreter to itself while it casts rays: for a whole picture that is half a second on a
busy machine, in which no other thread gets on, neither the one that waits for STOP nor the one that tells."""


class RayCaster:
    """Rays against one mesh, which must not change. Results do not depend on the number of threads.

    Raises `SceneError` for a mesh without triangles.
    """

    def __init__(self, mesh: TexturedMesh) -> None:
        if len(mesh.triangles) == 0:
            raise SceneError("cannot cast rays: the mesh has no triangles")
        self.mesh = mesh
        self._embree = o3d.t.geometry.RaycastingScene()
        self._embree.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.vertices_m)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.triangles, dtype=np.uint32)),
        )
        self._camera_rays: dict[CameraIntrinsics, Float32[ndarray, "n 3"]] = {}

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
        shape = (intrinsics.height, intrinsics.width)
        directions = self._directions_of(intrinsics)
        rgb, depth = self._look(directions, intrinsics, T_world_camera, range_m)
        uneven = np.flatnonzero(uneven_pixels(rgb.reshape(*shape, 3)))
        total = rgb[uneven].astype(np.uint16)
        focal_px = np.array([intrinsics.fx, intrinsics.fy], np.float32)
        for step in _CLOSER_LOOKS_PX / focal_px:
            aside = directions[uneven] + np.array([*step, 0.0], np.float32)
            total += self._look(aside, intrinsics, T_world_camera, np.inf)[0]
        looks = len(_CLOSER_LOOKS_PX) + 1
        rgb[uneven] = (total + looks // 2) // looks
        return rgb.reshape(*shape, 3), depth.reshape(shape)

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

    def _look(
        self,
        directions: Float32[ndarray, "n 3"],
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        range_m: float,
    ) -> tuple[UInt8[ndarray, "n 3"], Float32[ndarray, " n"]]:
        """One ray a direction of the camera (z = 1): colour and z-depth of what it meets."""
        rays = np.empty((len(directions), 6), dtype=np.float32)
        rays[:, :3] = T_world_camera.translation
        np.matmul(directions, T_world_camera.rotation.T.astype(np.float32), out=rays[:, 3:])
        rgb = np.empty((len(rays), 3), dtype=np.uint8)
        depth = np.empty(len(rays), dtype=np.float32)
        focal_px = (intrinsics.fx * intrinsics.fy) ** 0.5
        for first in range(0, len(rays), _RAYS_AT_ONCE):
            some = slice(first, first + _RAYS_AT_ONCE)
            self._look_along(rays[some], focal_px, range_m, rgb=rgb[some], depth_m=depth[some])
        return rgb, depth

    def _look_along(
        self,
        rays: Float32[ndarray, "n 6"],
        focal_px: float,
        range_m: float,
        *,
        rgb: UInt8[ndarray, "n 3"],
        depth_m: Float32[ndarray, " n"],
    ) -> None:
        # Directions have z = 1 in the camera, so Embree's ray parameter is the z-depth.
        hits = self._embree.cast_rays(o3d.core.Tensor.from_numpy(rays))
        look, pyramids = self._appearance, self._appearance.pyramids
        kernels.shade(
            hits["primitive_ids"].numpy(),
            hits["primitive_uvs"].numpy(),
            hits["t_hit"].numpy(),
            rays,
            look.uv,
            look.normal,
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
            focal_px=focal_px,
            range_m=range_m,
            background=BACKGROUND_RGB,
            rgb=rgb,
            depth_m=depth_m,
        )

    def _directions_of(self, intrinsics: CameraIntrinsics) -> Float32[ndarray, "n 3"]:
        if intrinsics not in self._camera_rays:
            self._camera_rays[intrinsics] = intrinsics.rays().reshape(-1, 3).astype(np.float32)
        return self._camera_rays[intrinsics]


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
