"""Diagonal Fisher information of the map (HGS-Planner Eq. 5-9, after FisherRF).

A rendered colour is a measurement with noise of unit variance, so the information that one view holds about
a parameter w is `H = sum over pixels and channels of (dC/dw)^2`: no ground truth is needed. Derivatives are
by the map's own parameters (log radius, logit opacity), chained *before* they are squared.

Of a disc the same 8 parameters count, with the derivatives of its own footprint: gains of maps of either
primitive compare. Its normal is left out: depth places it at once, and to the first order it moves no colour
where the disc is looked at along it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.native_backend import camera_numbers
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

UNCERTAIN_COLOUR: Final = 0.3
UNCERTAIN_CENTRE_M: Final = 0.025
UNCERTAIN_LOG_RADIUS: Final = 0.7
UNCERTAIN_LOGIT_OPACITY: Final = 2.0
"""How uncertain a parameter is before any view, as a standard deviation."""


def parameter_priors(prior_information: float) -> list[float]:
    """Eq. 9's lambda for each of the 8 parameters; `prior_information` is that of the colours.

    Information about a parameter is one over its variance, so one number for all would depend on units: a
    centre in metres holds 10^4 times as much as a colour, and a Gaussian that no view has seen would
    outweigh all that were seen. These priors are as sure of each parameter as of the colours.
    """
    uncertain = np.array(
        [UNCERTAIN_CENTRE_M] * 3 + [UNCERTAIN_COLOUR] * 3 + [UNCERTAIN_LOG_RADIUS, UNCERTAIN_LOGIT_OPACITY]
    )
    priors: list[float] = (prior_information * (UNCERTAIN_COLOUR / uncertain) ** 2).tolist()
    return priors


def accumulate_information(
    gaussians: GaussianMap,
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    far_m: float = np.inf,
    surface_m: Float32[ndarray, "height width"] | None = None,
    pixel_weight: float = 1.0,
) -> None:
    """Add the information of one view to `gaussians.information` (H_train of Eq. 9): `add_information`."""
    add_information(
        gaussians,
        intrinsics,
        T_world_camera,
        gaussians.information[: gaussians.size],
        far_m=far_m,
        surface_m=surface_m,
        pixel_weight=pixel_weight,
    )
    gaussians.version += 1


def view_information(
    gaussians: GaussianMap, intrinsics: CameraIntrinsics, T_world_camera: SE3
) -> Float32[ndarray, "size 8"]:
    """The information that a view would hold about each parameter; changes nothing."""
    information = np.zeros((gaussians.size, 8), np.float32)
    add_information(gaussians, intrinsics, T_world_camera, information)
    return information


def add_information(
    gaussians: GaussianMap,
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    information: Float32[ndarray, "size 8"],
    *,
    far_m: float = np.inf,
    surface_m: Float32[ndarray, "height width"] | None = None,
    pixel_weight: float = 1.0,
) -> None:
    """Add what a view tells of each parameter to `information`.

    `pixel_weight`: how many pixels of the camera each of `intrinsics` stands for: drawn at half the size,
    where each stands for four, a view tells as much. Gaussians at a depth of `far_m` and beyond, and those
    that `surface_m` hides (as in `render`), gain nothing: they are not learnt from that view either.
    """
    kernels.add_information(
        gaussians.parameters[: gaussians.size],
        gaussians.normals[: gaussians.size],
        gaussians.block_bounds,
        camera_numbers(intrinsics, T_world_camera, far_m=far_m),
        surface_m,
        intrinsics.width,
        intrinsics.height,
        pixel_weight,
        information,
    )


def quality_image(
    gaussians: GaussianMap,
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    prior_information: float,
    *,
    far_m: float = np.inf,
) -> Float32[ndarray, "height width"]:
    """The rendered quality gain (HGS-Planner figure 4): per pixel, `sum (dC/dw_k)^2 / (H_train + prior_k)`.

    Its sum over the image is `sum_i H_view,i / (H_train,i + prior)`, Eq. 9's gain of the view. Gaussians at a
    z-depth of `far_m` and beyond count for nothing.
    Raises `MapError` unless `prior_information` is positive.
    """
    if not prior_information > 0.0:
        raise MapError(f"prior_information must be positive, got {prior_information}")
    image = np.empty((intrinsics.height, intrinsics.width), np.float32)
    kernels.quality_image(
        gaussians.parameters[: gaussians.size],
        gaussians.normals[: gaussians.size],
        gaussians.block_bounds,
        camera_numbers(intrinsics, T_world_camera, far_m=far_m),
        gaussians.information[: gaussians.size],
        parameter_priors(prior_information),
        image,
    )
    return image
