"""Rendering on a CUDA device by gsplat (the extra `cuda`).

gsplat projects ellipsoids; the model here is a sphere drawn as a disc of radius `f r / z` (`rasterise.hpp`).
Both agree when each Gaussian is given to gsplat as a flat disc parallel to the image plane. What is left is
gsplat's own bound: it caps alpha at 0.999 instead of 0.99.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from hgs_core.errors import ConfigError
from hgs_core.gaussians.gaussian_map import CENTRE, LOG_RADIUS, LOGIT_OPACITY, RGB, GaussianMap
from hgs_core.gaussians.rendered_view import MapGradient, RenderedView
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

NEAR_M = 0.1
FARTHEST_M = 1e10
"""Far plane of an unlimited view."""


class GsplatBackend:
    """`RenderBackend` on the first CUDA device. Raises `ConfigError` where gsplat or a device is missing."""

    def __init__(self) -> None:
        import torch

        try:
            import gsplat
        except ImportError as error:
            raise ConfigError(
                "the render backend 'gsplat' is not installed: pip install 'hgs[cuda]', or use 'native'"
            ) from error
        if not torch.cuda.is_available():
            raise ConfigError(
                "the render backend 'gsplat' needs a CUDA device, and torch finds none: use 'native'"
            )
        self._torch = torch
        self._rasterization = gsplat.rasterization

    def forward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        *,
        far_m: float = np.inf,
        surface_m: Float32[ndarray, "height width"] | None = None,
    ) -> RenderedView:
        with self._torch.no_grad():
            sums = self._splat(self._parameters(gaussians), intrinsics, T_world_camera, far_m)
        colour, depth, silhouette = (image.cpu().numpy().astype(np.float32) for image in sums)
        return RenderedView(colour_sum=colour, depth_sum=depth, silhouette=silhouette)

    def backward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        d_colour: Float32[ndarray, "height width 3"],
        d_depth: Float32[ndarray, "height width"],
        d_silhouette: Float32[ndarray, "height width"],
    ) -> MapGradient:
        parameters = self._parameters(gaussians).requires_grad_()
        sums = self._splat(parameters, intrinsics, T_world_camera, np.inf)
        incoming = [self._torch.from_numpy(d).to(parameters) for d in (d_colour, d_depth, d_silhouette)]
        (gradient,) = self._torch.autograd.grad(sums, parameters, incoming)
        return MapGradient(
            parameters=gradient.cpu().numpy(), normals=np.zeros((gaussians.size, 0), np.float32)
        )

    def _parameters(self, gaussians: GaussianMap) -> Any:
        if gaussians.primitive != "isotropic":
            raise ConfigError(
                f"the render backend 'gsplat' draws isotropic Gaussians, not {gaussians.primitive!r}: "
                "it knows no depth that slopes within one; use 'native'"
            )
        return self._torch.from_numpy(gaussians.parameters[: gaussians.size]).cuda()

    def _splat(
        self, parameters: Any, intrinsics: CameraIntrinsics, T_world_camera: SE3, far_m: float
    ) -> tuple[Any, Any, Any]:
        torch = self._torch
        to_camera = torch.from_numpy(T_world_camera.inverse().as_matrix()).to(parameters)
        in_image_plane = to_camera[:2, :3].T @ to_camera[:2, :3]
        variance = torch.exp(2.0 * parameters[:, LOG_RADIUS])
        calibration = [
            [intrinsics.fx, 0.0, intrinsics.cx],
            [0.0, intrinsics.fy, intrinsics.cy],
            [0.0, 0.0, 1.0],
        ]
        image, silhouette, _ = self._rasterization(
            means=parameters[:, CENTRE],
            quats=None,
            scales=None,
            covars=variance[:, None, None] * in_image_plane,
            opacities=torch.sigmoid(parameters[:, LOGIT_OPACITY]),
            colors=parameters[:, RGB],
            viewmats=to_camera[None],
            Ks=torch.tensor([calibration]).to(parameters),
            width=intrinsics.width,
            height=intrinsics.height,
            near_plane=NEAR_M,
            far_plane=min(far_m, FARTHEST_M),
            eps2d=intrinsics.low_pass_px2,
            render_mode="RGB+D",
        )
        return image[0, ..., :3], image[0, ..., 3], silhouette[0, ..., 0]
