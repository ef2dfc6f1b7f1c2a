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
from hgs_core.gaussians.rendered_view import MapGradient, RenderedView
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

NEAR_M = 0.1
MIN_ALPHA = 1.0 / 255.0
MAX_ALPHA = 0.99
MIN_TRANSMITTANCE = 1e-4
WIDEST_TANGENT = 1.3


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
        surface_m: Float32[ndarray, "height width"] | None = None,
    ) -> RenderedView:
        with torch.no_grad():
            sums = splat(*self._rows(gaussians), intrinsics, T_world_camera, far_m=far_m)
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
    ) -> MapGradient:
        parameters, normals = (rows.requires_grad_() for rows in self._rows(gaussians))
        sums = splat(parameters, normals, intrinsics, T_world_camera)
        incoming = [torch.from_numpy(d).to(self.dtype) for d in (d_colour, d_depth, d_silhouette)]
        gradient, normal_gradient = torch.autograd.grad(
            sums, (parameters, normals), incoming, allow_unused=True, materialize_grads=True
        )
        return MapGradient(
            parameters=gradient.numpy().astype(np.float32), normals=normal_gradient.numpy().astype(np.float32)
        )

    def _rows(self, gaussians: GaussianMap) -> tuple[Float[Tensor, "size 8"], Float[Tensor, "size n_normal"]]:
        parameters = torch.from_numpy(gaussians.parameters[: gaussians.size]).to(self.dtype)
        return parameters, torch.from_numpy(gaussians.normals[: gaussians.size]).to(self.dtype)


def splat(
    parameters: Float[Tensor, "n 8"],
    normals: Float[Tensor, "n n_normal"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    far_m: float = np.inf,
) -> tuple[Float[Tensor, "height width 3"], Float[Tensor, "height width"], Float[Tensor, "height width"]]:
    """The sums C, D and A of every pixel (HGS-Planner Eq. 2), differentiable by parameters and normals."""
    seen = project(parameters, normals, intrinsics, T_world_camera, far_m=far_m)
    columns = torch.arange(intrinsics.width, dtype=parameters.dtype) + 0.5
    rows = torch.arange(intrinsics.height, dtype=parameters.dtype) + 0.5
    weight = seen.weights(slice(None), columns, rows)

    colour = torch.einsum("nhw,nc->hwc", weight, seen.rgb)
    depth = torch.einsum("nhw,nhw->hw", weight, seen.depths(slice(None), columns, rows))
    return colour, depth, weight.sum(dim=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ScreenSplats:
    """The Gaussians in front of the camera, front to back: on the screen [px], depth `z` [m]."""

    u: Float[Tensor, " n"]
    v: Float[Tensor, " n"]
    z: Float[Tensor, " n"]
    precision: Float[Tensor, "n 2 2"]
    """Q, the inverse of the covariance [1/px^2]."""
    slope: Float[Tensor, "n 2"]
    """Of the depth, by column and row [m/px]."""
    opacity: Float[Tensor, " n"]
    rgb: Float[Tensor, "n 3"]

    def weights(
        self, which: Int64[Tensor, " k"] | slice, columns: Float[Tensor, " w"], rows: Float[Tensor, " h"]
    ) -> Float[Tensor, "k h w"]:
        """`alpha T` of the chosen ones, in their order, at the pixels of some rows and columns."""
        across, down = self._offsets(which, columns, rows)
        q_xx, q_xy, q_yy = (self.precision[which, i, j, None, None] for i, j in ((0, 0), (0, 1), (1, 1)))
        square = q_xx * across**2 + 2.0 * q_xy * across * down + q_yy * down**2
        unclamped = self.opacity[which, None, None] * torch.exp(-0.5 * square)
        alpha = torch.where(
            unclamped >= MIN_ALPHA, unclamped.clamp(max=MAX_ALPHA), torch.zeros_like(unclamped)
        )
        after = torch.cumprod(1.0 - alpha, dim=0)
        before = torch.cat([torch.ones_like(after[:1]), after[:-1]])
        return torch.where(before >= MIN_TRANSMITTANCE, alpha * before, torch.zeros_like(alpha))

    def depths(
        self, which: Int64[Tensor, " k"] | slice, columns: Float[Tensor, " w"], rows: Float[Tensor, " h"]
    ) -> Float[Tensor, "k h w"]:
        """Depth [m] of the chosen ones at the pixels of some rows and columns."""
        across, down = self._offsets(which, columns, rows)
        slope_x, slope_y = (self.slope[which, axis, None, None] for axis in range(2))
        return self.z[which, None, None] + slope_x * across + slope_y * down

    def _offsets(
        self, which: Int64[Tensor, " k"] | slice, columns: Float[Tensor, " w"], rows: Float[Tensor, " h"]
    ) -> tuple[Float[Tensor, "k 1 w"], Float[Tensor, "k h 1"]]:
        return columns - self.u[which, None, None], rows[:, None] - self.v[which, None, None]


def project(
    parameters: Float[Tensor, "n 8"],
    normals: Float[Tensor, "n n_normal"],
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    far_m: float = np.inf,
) -> ScreenSplats:
    """What the Gaussians nearer than `far_m` are on the screen, differentiable by parameters and normals.

    With normals they are discs (n_normal = 3), without isotropic (n_normal = 0).
    """
    world_to_camera = torch.from_numpy(T_world_camera.inverse().as_matrix()).to(parameters.dtype)
    camera = parameters[:, CENTRE] @ world_to_camera[:3, :3].T + world_to_camera[:3, 3]
    in_front = torch.nonzero((camera[:, 2] > NEAR_M) & (camera[:, 2] < far_m)).squeeze(1)
    front_to_back = in_front[torch.argsort(camera[in_front, 2], stable=True)]
    x, y, z = camera[front_to_back].unbind(dim=1)
    chosen = parameters[front_to_back]
    radius = torch.exp(chosen[:, LOG_RADIUS])
    if normals.shape[1] == 0:
        variance = intrinsics.fx * intrinsics.fy * radius**2 / z**2 + intrinsics.low_pass_px2
        precision = torch.eye(2, dtype=z.dtype) / variance[:, None, None]
        slope = torch.zeros_like(chosen[:, :2])
    else:
        turned = normals[front_to_back] @ world_to_camera[:3, :3].T
        precision, slope = _disc_look(radius, turned, camera[front_to_back], intrinsics)
    return ScreenSplats(
        u=intrinsics.fx * x / z + intrinsics.cx,
        v=intrinsics.fy * y / z + intrinsics.cy,
        z=z,
        precision=precision,
        slope=slope,
        opacity=torch.sigmoid(chosen[:, LOGIT_OPACITY]),
        rgb=chosen[:, RGB],
    )


def _disc_look(
    radius: Float[Tensor, " n"],
    normal: Float[Tensor, "n 3"],
    centre: Float[Tensor, "n 3"],
    intrinsics: CameraIntrinsics,
) -> tuple[Float[Tensor, "n 2 2"], Float[Tensor, "n 2"]]:
    """Precision on the screen and slope of the depth of discs; normals and centres in the camera's frame.

    The covariance is r^2 (1 - n n'). Seen through the slope J of the projection it is that of a normal
    distribution of (column, row, depth), blurred by the low pass; the depth is its mean, given the pixel.
    """
    x, y, z = centre.unbind(dim=1)
    widest_x = WIDEST_TANGENT * max(intrinsics.cx, intrinsics.width - intrinsics.cx) / intrinsics.fx
    widest_y = WIDEST_TANGENT * max(intrinsics.cy, intrinsics.height - intrinsics.cy) / intrinsics.fy
    tangent_x, tangent_y = (x / z).clamp(-widest_x, widest_x), (y / z).clamp(-widest_y, widest_y)
    nought = torch.zeros_like(z)
    slope_of_projection = torch.stack(
        [
            torch.stack([intrinsics.fx / z, nought, -intrinsics.fx / z * tangent_x], dim=1),
            torch.stack([nought, intrinsics.fy / z, -intrinsics.fy / z * tangent_y], dim=1),
            torch.stack([nought, nought, torch.ones_like(z)], dim=1),
        ],
        dim=1,
    )
    unit = normal / normal.norm(dim=1, keepdim=True)
    in_plane = torch.eye(3, dtype=z.dtype) - unit[:, :, None] * unit[:, None, :]
    covariance = radius[:, None, None] ** 2 * in_plane
    seen = slope_of_projection @ covariance @ slope_of_projection.transpose(1, 2)
    blurred = seen[:, :2, :2] + intrinsics.low_pass_px2 * torch.eye(2, dtype=z.dtype)
    precision = torch.linalg.inv(blurred)
    return precision, (precision @ seen[:, :2, 2:]).squeeze(2)
