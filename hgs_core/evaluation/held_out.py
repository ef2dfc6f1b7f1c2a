"""Held-out views: the map drawn from poses that no frame was taken from, beside the truth.

Poses are drawn with a fixed seed from the reachable grid: the same for every planner on a scene. Masked
figures use pixels whose true surface point some training frame saw, so they tell how well the map shows
what was looked at; the unmasked ones and the mask's share tell what was never looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from jaxtyping import Bool, Float, Float32
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.evaluation.error_prediction import ErrorPredictors
from hgs_core.evaluation.images import masked_mean, psnr_db, ssim_map
from hgs_core.evaluation.result import ImageMetrics, ViewResult
from hgs_core.evaluation.training_views import seen_in_training
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.scene.ray_caster import RayCaster

N_VIEWS: Final = 40
VIEW_SEED: Final = 20_240_902
_MASK_SCALE: Final = 0.25
"""The mask is decided for one pixel in 4 x 4."""
_MIN_MASK_SHARE: Final = 0.01
"""Views that share less than this with the training frames have no masked figures of their own."""


def held_out_poses(
    positions_m: Float[ndarray, "p 2"],
    *,
    camera_height_m: float,
    n_views: int = N_VIEWS,
    seed: int = VIEW_SEED,
) -> SE3:
    """`n_views` level poses at random reachable positions and yaws, batched."""
    rng = np.random.default_rng(seed)
    chosen = positions_m[rng.integers(len(positions_m), size=n_views)]
    yaws = rng.uniform(-np.pi, np.pi, n_views)
    poses = [level_camera_pose(x, y, camera_height_m, yaw) for (x, y), yaw in zip(chosen, yaws, strict=True)]
    return SE3(
        rotation=np.stack([pose.rotation for pose in poses]),
        translation=np.stack([pose.translation for pose in poses]),
    )


def image_metrics(
    caster: RayCaster,
    gaussians: GaussianMap,
    *,
    poses: SE3,
    training_poses: SE3,
    intrinsics: CameraIntrinsics,
    range_m: float,
    progress: Callable[[str], None] | None = None,
) -> ImageMetrics:
    """Draw the map from each of `poses` and compare it with the true scene.

    Depth is compared where there is a true surface, at any distance. Raises `MapError` without poses.
    """
    n_views = len(poses.translation)
    if n_views == 0:
        raise MapError("image metrics need at least one held-out pose")
    if progress is not None:
        progress(f"held-out views: what {len(training_poses.translation)} training frames saw of them")
    masks = observed_masks(
        caster, poses=poses, training_poses=training_poses, intrinsics=intrinsics, range_m=range_m
    )
    predictors = ErrorPredictors.of(gaussians, intrinsics, training_poses, range_m=range_m)
    masked, unmasked, depth_errors, views = [], [], [], []
    for index in range(n_views):
        pose, mask = poses[index], masks[index]
        true_rgb, true_depth = caster.render(intrinsics, pose)
        reference = true_rgb.astype(np.float32) / 255.0
        view = render(gaussians, intrinsics, pose)
        colour = np.clip(view.colour, 0.0, 1.0)
        similarity = ssim_map(colour, reference)
        unmasked.append((psnr_db(colour, reference), masked_mean(similarity)))
        figures = (float("nan"), float("nan"))
        if mask.mean() >= _MIN_MASK_SHARE:
            figures = (psnr_db(colour, reference, mask), masked_mean(similarity, mask))
            error = np.abs(view.depth_m - true_depth)[mask & np.isfinite(true_depth)]
            depth_errors.append(error.astype(np.float32))
            masked.append((*figures, error.mean()))
        views.append(
            ViewResult(
                T_world_camera=pose,
                observed_share=float(mask.mean()),
                psnr_db=figures[0],
                ssim=figures[1],
                prediction=predictors.score(
                    np.abs(colour - reference).mean(axis=2), view.depth_m, mask, intrinsics, pose
                ),
            )
        )
        if progress is not None:
            progress(f"held-out views: {index + 1} of {n_views}")
    psnr, ssim, depth_l1 = np.mean(masked, axis=0) if masked else (np.nan, np.nan, np.nan)
    psnr_all, ssim_all = np.mean(unmasked, axis=0)
    errors = np.concatenate(depth_errors) if depth_errors else np.full(1, np.nan, np.float32)
    return ImageMetrics(
        n_views=n_views,
        psnr_db=float(psnr),
        ssim=float(ssim),
        depth_l1_cm=float(depth_l1) * 100,
        median_depth_error_cm=float(np.median(errors)) * 100,
        psnr_db_unmasked=float(psnr_all),
        ssim_unmasked=float(ssim_all),
        observed_mask_share=float(masks.mean()),
        views=tuple(views),
    )


def observed_masks(
    caster: RayCaster,
    *,
    poses: SE3,
    training_poses: SE3,
    intrinsics: CameraIntrinsics,
    range_m: float,
) -> Bool[ndarray, "n_views height width"]:
    """Pixels of each view whose true surface point some training frame saw; false beyond the world."""
    coarse = intrinsics.scaled(_MASK_SCALE)
    n_views = len(poses.translation)
    rays = coarse.rays().reshape(-1, 3)
    depth = np.empty((n_views, len(rays)), np.float32)
    points: Float32[ndarray, "n_views n_rays 3"] = np.zeros((n_views, len(rays), 3), np.float32)
    for index in range(n_views):
        pose = poses[index]
        directions = rays @ pose.rotation.T
        depth[index] = caster.cast(np.broadcast_to(pose.translation, directions.shape), directions)
        hit = np.isfinite(depth[index])
        points[index, hit] = pose.translation + directions[hit] * depth[index, hit, None]
    solid = np.isfinite(depth)
    seen = np.zeros_like(solid)
    seen[solid] = seen_in_training(
        caster,
        points[solid],
        training_poses=training_poses,
        intrinsics=intrinsics,
        range_m=range_m,
    )
    rows = np.arange(intrinsics.height) * coarse.height // intrinsics.height
    columns = np.arange(intrinsics.width) * coarse.width // intrinsics.width
    return seen.reshape(n_views, coarse.height, coarse.width)[:, rows[:, None], columns]
