"""What plain torch attains: the reference formulas over tiles, with the splats that reach each.

`TorchBackend` spells out every pair of splat and pixel, which no benchmark's map would survive. This is the
same model as a sensible torch programmer would write it; it agrees with the other backends to rounding.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray
from torch import Tensor

from hgs_core.gaussians.torch_backend import MIN_ALPHA, project
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

TILE: Final = 16


def splat_tiles(
    parameters: Float[Tensor, "n 8"], intrinsics: CameraIntrinsics, T_world_camera: SE3
) -> tuple[Float[Tensor, "height width 3"], Float[Tensor, "height width"], Float[Tensor, "height width"]]:
    """The sums C, D and A of every pixel (HGS-Planner Eq. 2) over isotropic Gaussians, differentiable."""
    dtype = parameters.dtype
    seen = project(parameters, parameters[:, :0], intrinsics, T_world_camera)
    u, v = seen.u, seen.v
    with torch.no_grad():
        reach = torch.sqrt(
            2.0 / seen.precision[:, 0, 0] * torch.log((seen.opacity / MIN_ALPHA).clamp(min=1.0))
        )
    features = torch.cat([seen.rgb, seen.z[:, None], torch.ones_like(seen.z[:, None])], dim=1)
    rows = []
    for top in range(0, intrinsics.height, TILE):
        bottom = min(top + TILE, intrinsics.height)
        in_row = torch.nonzero((v + reach >= top) & (v - reach <= bottom)).squeeze(1)
        tiles = []
        for left in range(0, intrinsics.width, TILE):
            right = min(left + TILE, intrinsics.width)
            here = in_row[(u[in_row] + reach[in_row] >= left) & (u[in_row] - reach[in_row] <= right)]
            columns = torch.arange(left, right, dtype=dtype) + 0.5
            lines = torch.arange(top, bottom, dtype=dtype) + 0.5
            weight = seen.weights(here, columns, lines)
            tiles.append(torch.einsum("nhw,nc->hwc", weight, features[here]))
        rows.append(torch.cat(tiles, dim=1))
    sums = torch.cat(rows, dim=0)
    return sums[..., :3], sums[..., 3], sums[..., 4]


class TorchIteration:
    """One step of optimisation in torch: L1 of colour and depth, autograd, Adam."""

    def __init__(
        self,
        parameters: Float32[ndarray, "n 8"],
        rgb: UInt8[ndarray, "height width 3"],
        depth_m: Float32[ndarray, "height width"],
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
    ) -> None:
        self._parameters = torch.from_numpy(parameters.copy()).requires_grad_()
        self._adam = torch.optim.Adam([self._parameters], lr=1e-4)
        self._rgb = torch.from_numpy(rgb.astype(np.float32) / 255.0)
        self._depth = torch.from_numpy(depth_m)
        self._view = (intrinsics, T_world_camera)

    def step(self) -> float:
        """Returns the loss."""
        self._adam.zero_grad()
        colour, depth, silhouette = splat_tiles(self._parameters, *self._view)
        covered = silhouette.clamp(min=0.05)
        loss = (colour / covered[..., None] - self._rgb).abs().mean()
        loss = loss + (depth / covered - self._depth).abs().mean()
        loss.backward()  # type: ignore[no-untyped-call]
        self._adam.step()
        return float(loss.detach())
