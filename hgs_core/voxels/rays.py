"""Depth images and scans as rays into a voxel map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.sensing.frame import Frame, Scan


@dataclass(frozen=True, kw_only=True, eq=False)
class RayEnds:
    """Rays from one point. A ray with `is_hit` ends on a surface; the others saw nothing up to their end."""

    origin_m: Float[ndarray, " 3"]
    ends_m: Float[ndarray, "n 3"]
    is_hit: Bool[ndarray, " n"]


def frame_rays(frame: Frame, *, range_m: float, pixel_stride: int) -> RayEnds:
    """The rays of every `pixel_stride`-th pixel that has something to say.

    Depth up to `range_m` (z-depth) is a hit; beyond it, and +inf, the ray is empty up to `range_m`;
    depth 0 (no return) gives no ray.
    """
    camera = frame.intrinsics
    first = pixel_stride // 2
    depth = frame.depth_m[first::pixel_stride, first::pixel_stride]
    rows, columns = np.nonzero(depth)
    measured = depth[rows, columns].astype(np.float64)
    is_hit = measured <= range_m
    z = np.minimum(measured, range_m)
    points = np.empty((len(z), 3))
    points[:, 0] = (columns * pixel_stride + (first + 0.5 - camera.cx)) / camera.fx * z
    points[:, 1] = (rows * pixel_stride + (first + 0.5 - camera.cy)) / camera.fy * z
    points[:, 2] = z
    pose = frame.T_world_camera
    return RayEnds(
        origin_m=np.asarray(pose.translation, np.float64), ends_m=pose.apply(points), is_hit=is_hit
    )


def scan_rays(scan: Scan, *, range_m: float) -> RayEnds:
    """The rays of a planar scan; ranges are along the ray, 0 and +inf as in `frame_rays`."""
    returned = scan.ranges_m > 0
    measured = scan.ranges_m[returned].astype(np.float64)
    bearings = scan.bearings_rad[returned]
    length = np.minimum(measured, range_m)[:, None]
    directions = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=1)
    return RayEnds(
        origin_m=np.asarray(scan.origin_m, np.float64),
        ends_m=scan.origin_m + length * directions,
        is_hit=measured <= range_m,
    )
