"""The reference rasteriser: the splatting model written down in torch, differentiated by autograd.

It spells out every (Gaussian, pixel) pair, so it is for small scenes: the truth that fast backends are tested
against, not a way to draw a house.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Float32
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
        self, gaussians: GaussianMap, intrinsics: CameraIntrinsics, T_world_camera: SE3
    ) -> RenderedView:
        with torch.no_grad():
            sums = splat(self._parameters(gaussians), intrinsics, T_world_camera)
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
    parameters: Float[Tensor, "n 8"], intrinsics: CameraIntrinsics, T_world_camera: SE3
) -> tuple[Float[Tensor, "height width 3"], Float[Tensor, "height width"], Float[Tensor, "height width"]]:
    """The sums C, D and A of every pixel (HGS-Planner Eq. 2), differentiable by `parameters`."""
    dtype = parameters.dtype
    world_to_camera = torch.from_numpy(T_world_camera.inverse().as_matrix()).to(dtype)
    camera = parameters[:, CENTRE] @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    in_front = torch.nonzero(camera[:, 2] > NEAR_M).squeeze(1)
    front_to_back = in_front[torch.argsort(camera[in_front, 2], stable=True)]
    x, y, z = camera[front_to_back].unbind(dim=1)
    chosen = parameters[front_to_back]

    u = intrinsics.fx * x / z + intrinsics.cx
    v = intrinsics.fy * y / z + intrinsics.cy
    focal_squared = intrinsics.fx * intrinsics.fy
    variance = focal_squared * torch.exp(2.0 * chosen[:, LOG_RADIUS]) / z**2 + intrinsics.low_pass_px2
    opacity = torch.sigmoid(chosen[:, LOGIT_OPACITY])

    columns = torch.arange(intrinsics.width, dtype=dtype) + 0.5
    rows = torch.arange(intrinsics.height, dtype=dtype) + 0.5
    squared_distance = (columns - u[:, None, None]) ** 2 + (rows[:, None] - v[:, None, None]) ** 2
    unclamped = opacity[:, None, None] * torch.exp(-squared_distance / (2.0 * variance[:, None, None]))
    alpha = torch.where(unclamped >= MIN_ALPHA, unclamped.clamp(max=MAX_ALPHA), torch.zeros_like(unclamped))

    after = torch.cumprod(1.0 - alpha, dim=0)
    before = torch.cat([torch.ones_like(after[:1]), after[:-1]])
    weight = torch.where(before >= MIN_TRANSMITTANCE, alpha * before, torch.zeros_like(alpha))

    colour = torch.einsum("nhw,nc->hwc", weight, chosen[:, RGB])
    depth = torch.einsum("nhw,n->hw", weight, z)
    return colour, depth, weight.sum(dim=0)
