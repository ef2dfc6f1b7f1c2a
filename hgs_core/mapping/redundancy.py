"""Whether a frame shows anything that the map does not show already."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import InsertionConfig, ThinningConfig
from hgs_core.mapping.insertion import missing_pixels
from hgs_core.mapping.keyframes import TrainingImage
from hgs_core.native import kernels

_COVERED = 0.8
_FEWEST_PIXELS = 1000


def moved_and_turned(pose: SE3, since: SE3) -> tuple[float, float]:
    """Distance between two poses [m], and the angle between them [degrees]."""
    moved_m = float(np.linalg.norm(pose.translation - since.translation))
    cosine = (np.trace(since.rotation.T @ pose.rotation) - 1.0) / 2.0
    return moved_m, float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def is_near(pose: SE3, learnt: SE3 | None, config: ThinningConfig) -> bool:
    """Whether the camera is about where it was for the frame that was learnt last; false before the first."""
    if learnt is None:
        return False
    moved_m, turned_deg = moved_and_turned(pose, learnt)
    return moved_m < config.translation_m and turned_deg < config.rotation_deg


def foretold_psnr(
    gaussians: GaussianMap, image: TrainingImage, insertion: InsertionConfig, config: ThinningConfig
) -> float | None:
    """PSNR [dB] of the map against `image` where the map foretells it so well that nothing is to be learnt;
    None where it does not: colours too far off, or too many pixels that the map leaves open or shows farther
    away. Looks at every second row and column.
    """
    few = every_second_pixel(image)
    n_measured = np.count_nonzero(few.measured)
    if n_measured == 0:
        return None
    rendered = render(gaussians, few.intrinsics, few.T_world_camera, far_m=few.farthest_m + kernels.BEHIND_M)
    missing = np.count_nonzero(missing_pixels(few, rendered, insertion)) / n_measured
    psnr_db = predicted_psnr(few, rendered, fewest_pixels=1)
    return psnr_db if missing <= config.missing_share and psnr_db >= config.psnr_db else None


def every_second_pixel(image: TrainingImage) -> TrainingImage:
    """Every second row and column of `image`, and the camera that sees just these rays."""
    depth_m = np.ascontiguousarray(image.depth_m[::2, ::2])
    height, width = depth_m.shape
    camera = image.intrinsics
    return TrainingImage(
        rgb=np.ascontiguousarray(image.rgb[::2, ::2]),
        depth_m=depth_m,
        intrinsics=replace(
            camera,
            width=width,
            height=height,
            fx=camera.fx / 2,
            fy=camera.fy / 2,
            # The centre of pixel i, at i + 1/2, is that of the pixel 2 i before, at 2 i + 1/2.
            cx=camera.cx / 2 + 0.25,
            cy=camera.cy / 2 + 0.25,
            low_pass_px2=camera.low_pass_px2 / 4,
        ),
        T_world_camera=image.T_world_camera,
    )


def predicted_psnr(
    image: TrainingImage, rendered: RenderedView, *, fewest_pixels: int = _FEWEST_PIXELS
) -> float:
    """PSNR [dB] over pixels with a depth that the map covers; NaN if they are fewer than `fewest_pixels`.

    Every other pixel of every other row is looked at: nobody asks for more digits, and it is done in every
    frame.
    """
    some = (slice(None, None, 2), slice(None, None, 2))
    silhouette, measured = rendered.silhouette[some], image.depth_m[some] > 0
    covered: Bool[ndarray, "h w"] = (silhouette > _COVERED) & measured
    if 4 * covered.sum() < fewest_pixels:
        return float("nan")
    colour: Float[ndarray, "n 3"] = rendered.colour_sum[some][covered] / silhouette[covered][:, None]
    difference: Float[ndarray, "n 3"] = colour - image.rgb[some][covered] / np.float32(255.0)
    return float(-10.0 * np.log10(max(float(np.mean(np.square(difference))), 1e-10)))
