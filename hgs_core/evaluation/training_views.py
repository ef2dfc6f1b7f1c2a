"""Which surface points the frames of a mission saw, by rays against the true mesh."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.scene.ray_caster import RayCaster

_CUBE_M: Final = 0.5
"""Points are culled by cubes of this size before any is projected."""
_CUBE_RADIUS_M: Final = _CUBE_M * 3**0.5 / 2
_ORDER_SEED: Final = 11


def seen_in_training(
    caster: RayCaster,
    points: Float32[ndarray, "n 3"],
    *,
    training_poses: SE3,
    intrinsics: CameraIntrinsics,
    range_m: float,
) -> Bool[ndarray, " n"]:
    """Which surface points [m] some training frame saw: inside its image, within range, nothing between.

    Exact. Points drop out once seen and cubes outside a frame's view are skipped, so cost follows what is in
    view and not yet seen.
    """
    seen = np.zeros(len(points), dtype=bool)
    if len(points) == 0:
        return seen
    cubes, cube_of = np.unique(np.floor(points / _CUBE_M).astype(np.int32), axis=0, return_inverse=True)
    by_cube = np.argsort(cube_of.ravel(), kind="stable")
    waiting: list[Int[ndarray, " n_in_cube"]] = np.split(
        by_cube, np.cumsum(np.bincount(cube_of.ravel()))[:-1]
    )
    centres = (cubes + 0.5) * _CUBE_M
    # Frames in random order: neighbours in time see much the same, far ones leave fewer points early.
    for index in np.random.default_rng(_ORDER_SEED).permutation(len(training_poses.translation)):
        camera = training_poses[index]
        in_view = _cubes_in_view(camera.inverse().apply(centres), intrinsics, range_m)
        chosen = [cube for cube in np.flatnonzero(in_view) if len(waiting[cube])]
        if not chosen:
            continue
        candidates = np.concatenate([waiting[cube] for cube in chosen])
        camera_points = camera.inverse().apply(points[candidates])
        _, inside = intrinsics.project(camera_points)
        candidates = candidates[inside & (camera_points[:, 2] <= range_m)]
        seen[candidates[caster.visible(camera.translation, points[candidates])]] = True
        for cube in chosen:
            waiting[cube] = waiting[cube][~seen[waiting[cube]]]
    return seen


def _cubes_in_view(
    centres_camera: Float[ndarray, "n 3"], intrinsics: CameraIntrinsics, range_m: float
) -> Bool[ndarray, " n"]:
    """Cubes whose enclosing sphere reaches into the view; a sphere near an edge may pass without doing so."""
    x, y, z = centres_camera.T
    in_view = (z > -_CUBE_RADIUS_M) & (z < range_m + _CUBE_RADIUS_M)
    for along, focal, lower, upper in (
        (x, intrinsics.fx, intrinsics.cx, intrinsics.width - intrinsics.cx),
        (y, intrinsics.fy, intrinsics.cy, intrinsics.height - intrinsics.cy),
    ):
        for side, extent in ((-along, lower), (along, upper)):
            # Signed distance from the plane through the image's edge, positive outside.
            slope = extent / focal
            in_view &= (side - slope * z) / np.hypot(1.0, slope) < _CUBE_RADIUS_M
    return in_view
