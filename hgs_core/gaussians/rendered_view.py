"""What a renderer returns, and what every renderer is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

MIN_SILHOUETTE: Final = 1e-3
"""Where no more than this was drawn, `RenderedView.colour` and `.depth_m` are 0."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderedView:
    """Front-to-back sums over the Gaussians of each pixel (HGS-Planner Eq. 2), not divided by anything.

    The sums are what gradients refer to. `colour` and `depth_m` are what a viewer or a metric wants: the sums
    divided by how much was drawn, so that a half-covered pixel is neither dark nor near.
    """

    colour_sum: Float32[ndarray, "height width 3"]
    """C = sum rgb_i alpha_i T_i."""
    depth_sum: Float32[ndarray, "height width"]
    """D = sum z_i alpha_i T_i [m]."""
    silhouette: Float32[ndarray, "height width"]
    """A = sum alpha_i T_i, 0..1."""

    @property
    def colour(self) -> Float32[ndarray, "height width 3"]:
        """C / A, 0 where A <= `MIN_SILHOUETTE`. Not clipped: colours are free parameters."""
        return self.colour_sum * self._inverse_silhouette()[..., None]

    @property
    def depth_m(self) -> Float32[ndarray, "height width"]:
        """D / A [m], 0 (no measurement) where A <= `MIN_SILHOUETTE`."""
        return self.depth_sum * self._inverse_silhouette()

    def _inverse_silhouette(self) -> Float32[ndarray, "height width"]:
        drawn = self.silhouette > MIN_SILHOUETTE
        inverse: Float32[ndarray, "height width"] = np.zeros_like(self.silhouette)
        np.divide(np.float32(1.0), self.silhouette, out=inverse, where=drawn)
        return inverse


@dataclass(frozen=True, kw_only=True, eq=False)
class MapGradient:
    """Of a loss, by everything that is optimised of a map."""

    parameters: Float32[ndarray, "size 8"]
    normals: Float32[ndarray, "size n_normal"]
    """Of discs, tangent to the unit sphere (size, 3); isotropic: (size, 0)."""


@runtime_checkable
class RenderBackend(Protocol):
    """One implementation of the splatting model.

    An isotropic Gaussian appears with variance `(f r / z)^2 + low_pass_px2` px^2 (f: geometric mean of fx and
    fy; the camera says `low_pass_px2`) at the depth of its centre; a disc by EWA splatting with the same low
    pass, at the depth of its plane (`rasterise.hpp`). Alpha is at most 0.99 and dropped below 1/255, and
    centres are drawn if farther than 0.1 m and nearer than `far_m`; blending goes by the depth of the centres
    and ends at a transmittance of 1e-4. What lies more than 0.3 m behind `surface_m`, a depth image of the
    same view (0: not measured, +inf: nothing there), may be left out for speed.
    """

    def forward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        *,
        far_m: float = np.inf,
        surface_m: Float32[ndarray, "height width"] | None = None,
    ) -> RenderedView: ...

    def backward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        d_colour: Float32[ndarray, "height width 3"],
        d_depth: Float32[ndarray, "height width"],
        d_silhouette: Float32[ndarray, "height width"],
    ) -> MapGradient:
        """Gradient of a loss by the map, from its gradients by the three sums."""
        ...
