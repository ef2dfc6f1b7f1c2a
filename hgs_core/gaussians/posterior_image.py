"""What the map is unsure of, pixel by pixel (HGS-Planner figure 4): the posterior variance of its colours.

By Eq. 9 the Hessian of the map's parameters is `H = H_train + lambda I`, diagonal, and by the Laplace
approximation behind it the variance of a parameter is 1 / H. A Gaussian's colour enters a pixel with its
blending weight w, so `H_train = sum over frames and pixels of w^2`: how much of the frames it filled. A pixel
shows the mean of its Gaussians' variances, weighted as their colours are:
`(sum w / (H_train + lambda)) / (sum w)`.

Against Eq. 9's gain of a single pixel, `sum (dC/dw)^2 / (H_train + lambda)`, this leaves out how strongly the
one pixel would tell of a parameter: that factor ranks *views* by what they would teach, while a map's error
at a pixel depends on what has been learnt.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import RGB, GaussianMap
from hgs_core.gaussians.information import UNCERTAIN_COLOUR, add_information
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

_COLOUR_NOISE: Final = 0.03
"""Standard deviation of a frame's colours about what the best map could show."""
PRIOR_INFORMATION: Final = (_COLOUR_NOISE / UNCERTAIN_COLOUR) ** 2
"""Lambda: what the prior knows of a colour, in pixels that would tell as much."""


def train_information(
    gaussians: GaussianMap,
    intrinsics: CameraIntrinsics,
    poses: SE3,
    *,
    far_m: float,
    most_frames: int = 200,
) -> Float32[ndarray, "size 8"]:
    """H_train of a finished map: the information of all frames (`poses` batched) about its parameters.

    It takes no image. Gaussians at a depth of `far_m` and beyond are not learnt from a frame. Of more frames
    than `most_frames` as many are drawn, evenly spread, and count for the others.
    """
    information = np.zeros((gaussians.size, 8), np.float32)
    n_poses = len(poses.translation)
    drawn = np.unique(np.linspace(0, n_poses - 1, min(n_poses, most_frames)).round().astype(int))
    for index in drawn:
        add_information(
            gaussians, intrinsics, poses[index], information, far_m=far_m, pixel_weight=n_poses / len(drawn)
        )
    return information


class PosteriorImages:
    """Renders the posterior variance of a map's colours, from any pose."""

    def __init__(self, gaussians: GaussianMap, information: Float32[ndarray, "size 8"]) -> None:
        """Raises `MapError` unless there is one row of `information` a Gaussian."""
        if len(information) != gaussians.size:
            raise MapError(f"{len(information)} rows of information for {gaussians.size} Gaussians")
        parameters = gaussians.parameters.copy()
        parameters[: gaussians.size, RGB] = 1.0 / (information[:, RGB] + np.float32(PRIOR_INFORMATION))
        self._variances = replace(gaussians, parameters=parameters)

    def render(self, intrinsics: CameraIntrinsics, T_world_camera: SE3) -> Float32[ndarray, "height width"]:
        """Variance of a colour, in units of a frame's noise; 0 where nothing is drawn."""
        # All three channels hold the same: a blending weight knows no colour.
        return np.ascontiguousarray(render(self._variances, intrinsics, T_world_camera).colour[..., 0])
