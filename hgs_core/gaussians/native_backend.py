"""The C++ rasteriser: every core, no GPU."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

import hgs_core.native.kernels as kernels
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.rendered_view import MapGradient, RenderedView
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3


class NativeBackend:
    """Blocks outside the view cost one box test each; the rest of the work follows what is visible.

    The result does not depend on the number of threads.
    """

    def forward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        *,
        far_m: float = np.inf,
        surface_m: Float32[ndarray, "height width"] | None = None,
    ) -> RenderedView:
        shape = (intrinsics.height, intrinsics.width)
        view = RenderedView(
            colour_sum=np.empty((*shape, 3), np.float32),
            depth_sum=np.empty(shape, np.float32),
            silhouette=np.empty(shape, np.float32),
        )
        kernels.render_sums(
            gaussians.parameters[: gaussians.size],
            gaussians.normals[: gaussians.size],
            gaussians.block_bounds,
            camera_numbers(intrinsics, T_world_camera, far_m=far_m),
            surface_m,
            view.colour_sum,
            view.depth_sum,
            view.silhouette,
        )
        return view

    def backward(
        self,
        gaussians: GaussianMap,
        intrinsics: CameraIntrinsics,
        T_world_camera: SE3,
        d_colour: Float32[ndarray, "height width 3"],
        d_depth: Float32[ndarray, "height width"],
        d_silhouette: Float32[ndarray, "height width"],
    ) -> MapGradient:
        gradient = MapGradient(
            parameters=np.zeros((gaussians.size, 8), np.float32),
            normals=np.zeros_like(gaussians.normals[: gaussians.size]),
        )
        kernels.render_gradient(
            gaussians.parameters[: gaussians.size],
            gaussians.normals[: gaussians.size],
            gaussians.block_bounds,
            camera_numbers(intrinsics, T_world_camera),
            np.ascontiguousarray(d_colour),
            np.ascontiguousarray(d_depth),
            np.ascontiguousarray(d_silhouette),
            gradient.parameters,
            gradient.normals,
        )
        return gradient


def camera_numbers(
    intrinsics: CameraIntrinsics, T_world_camera: SE3, *, far_m: float = np.inf
) -> list[float]:
    """What the kernels take as a camera: fx, fy, cx, cy, the rows of T_camera_world (3 x 4), low_pass_px2,
    far_m."""
    world_to_camera = T_world_camera.inverse().as_matrix()[:3]
    return [
        intrinsics.fx,
        intrinsics.fy,
        intrinsics.cx,
        intrinsics.cy,
        *(float(number) for number in world_to_camera.ravel()),
        intrinsics.low_pass_px2,
        far_m,
    ]
