"""The observable ceiling: what of the true surface any reachable camera pose can see.

A level camera at `height` with free yaw sees a point at horizontal distance `d` and height difference `h`
when some yaw puts it inside the image, within range, with nothing between. Turned away by `a` (at most half
the horizontal field of view, `A`), the point's z-depth is `z = d cos a` and it appears `h / z` above or
below the centre. So `a` can give any z-depth in `[d cos A, d]`; the largest allowed one, `z = min(d,
range)`, is also the most forgiving of height. A point is therefore in view of a position exactly when

    d cos A <= range    and    |h| <= tan(V) * min(d, range)

with `tan(V)` the half height of the image over the focal length. Faces are seen from either side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.scene.ray_caster import RayCaster

_ORDER_SEED: Final = 7
_PROGRESS_EVERY: Final = 100


def in_view_at_some_yaw(
    points: Float[ndarray, "n 3"],
    position: Float[ndarray, " 3"],
    *,
    intrinsics: CameraIntrinsics,
    range_m: float,
) -> Bool[ndarray, " n"]:
    """The rule above, occlusion aside. The narrower half of an off-centre image counts."""
    half_width = min(intrinsics.cx, intrinsics.width - intrinsics.cx) / intrinsics.fx
    half_height = min(intrinsics.cy, intrinsics.height - intrinsics.cy) / intrinsics.fy
    offset = points - position
    distance = np.hypot(offset[:, 0], offset[:, 1])
    within_range = distance * np.cos(np.arctan(half_width)) <= range_m
    within_height = np.abs(offset[:, 2]) <= half_height * np.minimum(distance, range_m)
    return within_range & within_height & (distance > 0)


def observable_mask(
    caster: RayCaster,
    samples: Float[ndarray, "n 3"],
    *,
    positions_m: Float[ndarray, "p 2"],
    camera_height_m: float,
    intrinsics: CameraIntrinsics,
    range_m: float,
    progress: Callable[[str], None] | None = None,
) -> Bool[ndarray, " n"]:
    """Which of `samples` [m] a camera at one of `positions_m` can see at some yaw."""
    seen = np.zeros(len(samples), dtype=bool)
    # Spatial order keeps neighbouring rays together; far-apart positions first leave few points early.
    waiting = _spatial_order(samples)
    order = np.random.default_rng(_ORDER_SEED).permutation(len(positions_m))
    waiting_points = samples[waiting].astype(np.float32)
    for count, index in enumerate(order):
        position = np.array([*positions_m[index], camera_height_m], np.float32)
        near = np.flatnonzero(
            in_view_at_some_yaw(waiting_points, position, intrinsics=intrinsics, range_m=range_m)
        )
        found = near[caster.visible(position, waiting_points[near])]
        if len(found):
            seen[waiting[found]] = True
            kept = np.ones(len(waiting), dtype=bool)
            kept[found] = False
            waiting, waiting_points = waiting[kept], waiting_points[kept]
        if progress is not None and (count + 1) % _PROGRESS_EVERY == 0:
            progress(f"observable surface: {count + 1} of {len(order)} positions, {seen.mean():.1%} seen")
    return seen


def _spatial_order(points: Float[ndarray, "n 3"]) -> ndarray:
    """Indices that sort points by cubes of half a metre."""
    cubes = np.floor(points / 0.5).astype(np.int64)
    return np.lexsort((cubes[:, 2], cubes[:, 1], cubes[:, 0]))
