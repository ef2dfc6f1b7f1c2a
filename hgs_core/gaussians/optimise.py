"""One optimisation step of the map against one RGB-D view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float32, UInt8
from numpy import ndarray
from pydantic import Field

import hgs_core.native.kernels as kernels
from hgs_core.config.base import StrictConfig
from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.native_backend import camera_numbers
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3


class LossWeights(StrictConfig):
    """Weights of the terms of the loss, each a mean over the pixels with a depth."""

    colour: float = Field(4.0, ge=0)
    """Of |C/A - rgb|, mean of the three channels [1 per unit of colour]."""
    depth: float = Field(1.0, ge=0)
    """Of |D/A - depth| [1/m]."""
    silhouette: float = Field(0.15, ge=0)
    """Of (1 - A)^2: a pixel with a depth shows a surface, so nothing may shine through."""
    free: float = Field(0.15, ge=0)
    """Of A^2, where the camera found nothing within its range: so surfaces end where they end."""


class LearningRates(StrictConfig):
    """Adam (Kingma and Ba 2015): step sizes by parameter, and its constants."""

    centre: float = Field(2e-4, ge=0)
    """Of the centre [m a step]."""
    rgb: float = Field(2.5e-3, ge=0)
    """Of the colour [1 a step]."""
    log_radius: float = Field(0.02, ge=0)
    """Of the logarithm of the radius [1 a step]."""
    normal: float = Field(0.02, ge=0)
    """Of the normal of a disc, which stays a unit vector [1 a step]."""
    logit_opacity: float = Field(0.2, ge=0)
    """Of the logit of the opacity [1 a step]."""
    beta1: float = Field(0.9, ge=0, lt=1)
    """Decay of the first moment per step."""
    beta2: float = Field(0.99, ge=0, lt=1)
    """Decay of the second moment per step."""
    epsilon: float = Field(1e-15, gt=0)
    """Added to the root of the second moment."""

    def scaled(self, factor: float) -> LearningRates:
        """The same with every step size multiplied."""
        sizes = {name: factor * getattr(self, name) for name in _STEP_SIZES}
        return self.model_copy(update=sizes)


_STEP_SIZES: Final = ("centre", "rgb", "log_radius", "normal", "logit_opacity")


@dataclass(frozen=True, kw_only=True)
class OptimisationLoss:
    """What one step measured before it moved anything."""

    total: float
    """The loss that was differentiated."""
    colour_l1: float
    """|C/A - rgb|, mean over channels and covered pixels (A > 0.05, valid depth); 0 if there are none."""
    depth_l1_m: float
    """|D/A - depth| [m], mean over covered pixels; 0 if there are none."""
    pixels: int
    """Pixels with a valid depth. 0: nothing was compared and nothing moved."""
    covered_pixels: int
    """Of those, how many the map covers."""


def optimise_step(
    gaussians: GaussianMap,
    rgb: UInt8[ndarray, "height width 3"],
    depth_m: Float32[ndarray, "height width"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    weights: LossWeights,
    rates: LearningRates,
    range_m: float = math.inf,
    radius_limits_m: tuple[float, float] = (0.001, 0.3),
) -> OptimisationLoss:
    """Render, compare, differentiate and move: one Adam step of every Gaussian that got a gradient, in place.

    Per pixel with `0 < depth < inf`, averaged over these pixels, and the first two only where A > 0.05:
    `colour |C/A - rgb| + depth |D/A - depth| + silhouette (1 - A)^2`; where depth is +inf, nothing being
    nearer than `range_m`, `free A^2`, divided by the same number. Gaussians beyond `range_m`, or more than
    0.3 m farther than all depths of the tiles (16 x 16 pixels) that they touch, are left out: other rooms lie
    in the frustum, but not in the picture. Steps are counted per Gaussian. Radii are kept within
    `radius_limits_m` [m]; `block_bounds` grow where a Gaussian leaves them. Raises `MapError` when the images
    do not fit the camera.
    """
    total, colour_l1, depth_l1_m, pixels, covered = kernels.optimise_view(
        *_arguments(
            gaussians, rgb, depth_m, intrinsics, T_world_camera, weights, rates, range_m, radius_limits_m
        )
    )
    gaussians.version += 1
    return OptimisationLoss(
        total=total, colour_l1=colour_l1, depth_l1_m=depth_l1_m, pixels=pixels, covered_pixels=covered
    )


@dataclass(frozen=True, kw_only=True)
class StepStages:
    """Where the time of one step goes [s], and how much arithmetic its loops do."""

    prepare_s: float
    """Projection, culling, sort, lists by tile."""
    forward_s: float
    """The forward sweep of every tile."""
    backward_s: float
    """The loss and the backward sweep of every tile."""
    step_s: float
    """From sums over pixels to parameters, and Adam."""
    evaluations: float
    """(splat, pixel) pairs that a sweep goes over."""


def time_step(
    gaussians: GaussianMap,
    rgb: UInt8[ndarray, "height width 3"],
    depth_m: Float32[ndarray, "height width"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    weights: LossWeights,
    rates: LearningRates,
    range_m: float = math.inf,
    radius_limits_m: tuple[float, float] = (0.001, 0.3),
) -> StepStages:
    """The work of `optimise_step` in separate, timed passes, for benchmarks; the map moves as there, but that
    nothing is left out behind tiles with a pixel that was not measured."""
    prepare_s, forward_s, backward_s, step_s, evaluations = kernels.time_stages(
        *_arguments(
            gaussians, rgb, depth_m, intrinsics, T_world_camera, weights, rates, range_m, radius_limits_m
        )
    )
    gaussians.version += 1
    return StepStages(
        prepare_s=prepare_s,
        forward_s=forward_s,
        backward_s=backward_s,
        step_s=step_s,
        evaluations=evaluations,
    )


def _arguments(
    gaussians: GaussianMap,
    rgb: UInt8[ndarray, "height width 3"],
    depth_m: Float32[ndarray, "height width"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    weights: LossWeights,
    rates: LearningRates,
    range_m: float,
    radius_limits_m: tuple[float, float],
) -> tuple[Any, ...]:
    """What the kernels of a step take. Raises `MapError` when it does not fit together."""
    shape = (intrinsics.height, intrinsics.width)
    if rgb.shape[:2] != shape or depth_m.shape != shape:
        raise MapError(f"the camera has {shape} pixels; rgb has {rgb.shape[:2]}, depth {depth_m.shape}")
    lower_m, upper_m = radius_limits_m
    if not 0.0 < lower_m < upper_m:
        raise MapError(f"radius_limits_m must be 0 < lower < upper, got {radius_limits_m}")
    size = gaussians.size
    by_parameter = [*[rates.centre] * 3, *[rates.rgb] * 3, rates.log_radius, rates.logit_opacity]
    return (
        gaussians.parameters[:size],
        gaussians.adam_first_moment[:size],
        gaussians.adam_second_moment[:size],
        gaussians.normals[:size],
        gaussians.normal_first_moment[:size],
        gaussians.normal_second_moment[:size],
        gaussians.adam_steps[:size],
        gaussians.block_bounds,
        camera_numbers(intrinsics, T_world_camera, far_m=range_m),
        np.ascontiguousarray(rgb),
        np.ascontiguousarray(depth_m),
        [weights.colour, weights.depth, weights.silhouette, weights.free],
        [
            *by_parameter,
            rates.beta1,
            rates.beta2,
            rates.epsilon,
            float(np.log(lower_m)),
            float(np.log(upper_m)),
            rates.normal,
        ],
    )
