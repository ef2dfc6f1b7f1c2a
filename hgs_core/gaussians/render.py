"""Rendering a Gaussian map: `render()` and the choice of a backend."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from jaxtyping import Float32
from numpy import ndarray

from hgs_core.errors import ConfigError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.native_backend import NativeBackend
from hgs_core.gaussians.rendered_view import RenderBackend, RenderedView
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3


def render(
    gaussians: GaussianMap,
    intrinsics: CameraIntrinsics,
    T_world_camera: SE3,
    *,
    far_m: float = math.inf,
    surface_m: Float32[ndarray, "height width"] | None = None,
    backend: str = "native",
) -> RenderedView:
    """Draw the map, up to a depth of `far_m`, as the camera at `T_world_camera` would see it.

    `surface_m`: the depth image that was measured from there, if any; see `RenderBackend`.

    Raises `ConfigError` for an unknown backend.
    """
    return render_backend(backend).forward(
        gaussians, intrinsics, T_world_camera, far_m=far_m, surface_m=surface_m
    )


def render_backend(name: str) -> RenderBackend:
    """The backend called `name`. Raises `ConfigError` naming those there are."""
    if name not in _BACKENDS:
        raise ConfigError(f"no render backend {name!r}; there are: {', '.join(sorted(_BACKENDS))}")
    return _BACKENDS[name]()


def _torch() -> RenderBackend:
    from hgs_core.gaussians.torch_backend import TorchBackend  # torch takes seconds to import

    return TorchBackend()


def _gsplat() -> RenderBackend:
    from hgs_core.gaussians.gsplat_backend import GsplatBackend

    return GsplatBackend()


_BACKENDS: Final[dict[str, Callable[[], RenderBackend]]] = {
    "native": NativeBackend,
    "torch": _torch,
    "gsplat": _gsplat,
}
