"""The reference rasteriser: the splatting model written down in torch, differentiated by autograd.

It spells out every (Gaussian, pixel) pair, so it is for small scenes: the truth that fast backends are tested
against, not a way to draw a house.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Int64
from numpy import ndarray
from torch import Tensor

from hgs_core.gaussians.gaussian_map import CENTRE, LOG_RADIUS, LOGIT_OPACITY, RGB, GaussianMap
from hgs_core.gaussians.rendered_view import RenderedView
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

NEAR_M = 0.1
MIN_ALPHA = 1.0 / 255.0
MAX_ALPHA = 0.99
MIN_TRANSMITTANCE = 1e-4


class TorchBackend:
    """`RenderBackend` in plain torch, in float64 unless told otherwise."""

    def __init__(self, dtype: torch.dtype = torch.float64) -> None:
        self.dtype = dtype

    def forward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        *,
        far_m: float = np.inf,
    ) -> RenderedView:
        with torch.no_grad():
            sums = splat(self._parameters(gaussians), intrinsics, T_world_camera, far_m=far_m)
        colour, depth, silhouette = (image.numpy().astype(np.float32) for image in sums)
        return RenderedView(colour_sum=colour, depth_sum=depth, silhouette=silhouette)

    def backward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        d_colour: Float32[ndarray, "height width 3"],
        d_depth: Float32[ndarray, "height width"],
        d_silhouette: Float32[ndarray, "height width"],
    ) -> Float32[ndarray, "size 8"]:
        parameters = self._parameters(gaussians).requires_grad_()
        sums = splat(parameters, intrinsics, T_world_camera)
        incoming = [torch.from_numpy(d).to(self.dtype) for d in (d_colour, d_depth, d_silhouette)]
        (gradient,) = torch.autograd.grad(sums, parameters, incoming)
        return gradient.numpy().astype(np.float32)

    def _parameters(self, gaussians: GaussianMap) -> Float[Tensor, "size 8"]:
        return torch.from_numpy(gaussians.parameters[: gaussians.size]).to(self.dtype)


def splat(
    parameters: Float[Tensor, "n 8"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    far_m: float = np.inf,
) -> tuple[Float[Tensor, "height width 3"], Float[Tensor, "height width"], Float[Tensor, "height width"]]:
    """The sums C, D and A of every pixel (HGS-Planner Eq. 2), differentiable by `parameters`."""
    seen = project(parameters, intrinsics, T_world_camera, far_m=far_m)
    columns = torch.arange(intrinsics.width, dtype=parameters.dtype) + 0.5
    rows = torch.arange(intrinsics.height, dtype=parameters.dtype) + 0.5
    weight = seen.weights(slice(None), columns, rows)

    colour = torch.einsum("nhw,nc->hwc", weight, seen.rgb)
    depth = torch.einsum("nhw,n->hw", weight, seen.z)
    return colour, depth, weight.sum(dim=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ScreenSplats:
    """The Gaussians in front of the camera, front to back: on the screen [px], depth `z` [m]."""

    u: Float[Tensor, " n"]
    v: Float[Tensor, " n"]
    z: Float[Tensor, " n"]
    variance: Float[Tensor, " n"]
    opacity: Float[Tensor, " n"]
    rgb: Float[Tensor, "n 3"]

    def weights(
        self, which: Int64[Tensor, " k"] | slice, columns: Float[Tensor, " w"], rows: Float[Tensor, " h"]
    ) -> Float[Tensor, "k h w"]:
        """`alpha T` of the chosen ones, in their order, at the pixels of some rows and columns."""
        across = (columns - self.u[which, None, None]) ** 2
        down = (rows[:, None] - self.v[which, None, None]) ** 2
        variance, opacity = self.variance[which, None, None], self.opacity[which, None, None]
        unclamped = opacity * torch.exp(-(across + down) / (2.0 * variance))
        alpha = torch.where(
            unclamped >= MIN_ALPHA, unclamped.clamp(max=MAX_ALPHA), torch.zeros_like(unclamped)
        )
        after = torch.cumprod(1.0 - alpha, dim=0)
        before = torch.cat([torch.ones_like(after[:1]), after[:-1]])
        return torch.where(before >= MIN_TRANSMITTANCE, alpha * before, torch.zeros_like(alpha))


def project(
    parameters: Float[Tensor, "n 8"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    far_m: float = np.inf,
) -> ScreenSplats:
    """What `parameters` nearer than `far_m` are on the screen, differentiable by them."""
    world_to_camera = torch.from_numpy(T_world_camera.inverse().as_matrix()).to(parameters.dtype)
    camera = parameters[:, CENTRE] @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    in_front = torch.nonzero((camera[:, 2] > NEAR_M) & (camera[:, 2] < far_m)).squeeze(1)
    front_to_back = in_front[torch.argsort(camera[in_front, 2], stable=True)]
    x, y, z = camera[front_to_back].unbind(dim=1)
    chosen = parameters[front_to_back]
    focal_squared = intrinsics.fx * intrinsics.fy
    return ScreenSplats(
        u=intrinsics.fx * x / z + intrinsics.cx,
        v=intrinsics.fy * y / z + intrinsics.cy,
        z=z,
        variance=focal_squared * torch.exp(2.0 * chosen[:, LOG_RADIUS]) / z**2 + intrinsics.low_pass_px2,
        opacity=torch.sigmoid(chosen[:, LOGIT_OPACITY]),
        rgb=chosen[:, RGB],
    )
