"""Lenses: where a camera that is no pinhole shows a ray.

Closed forms as OpenCV and ROS's `sensor_msgs/CameraInfo` define them, on the plane z = 1 of the camera.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import ConfigError
from hgs_core.geometry.camera import CameraIntrinsics

DistortionModel = Literal["none", "plumb_bob", "rational_polynomial", "equidistant"]

_N_COEFFICIENTS: Final[dict[str, tuple[int, ...]]] = {
    "none": (0,),
    "plumb_bob": (4, 5),
    "rational_polynomial": (8,),
    "equidistant": (4,),
}
_WIDEST_ZOOM: Final = 8.0
_BORDER_SAMPLES: Final = 65


@dataclass(frozen=True, kw_only=True)
class Distortion:
    """How a lens moves the image of a ray.

    | model | coefficients | |
    |---|---|---|
    | `none` | | a pinhole |
    | `plumb_bob` | k1 k2 p1 p2 [k3] | polynomial in r^2, and tangential (Brown-Conrady) |
    | `rational_polynomial` | k1 k2 p1 p2 k3 k4 k5 k6 | the polynomial divided by another |
    | `equidistant` | k1 k2 k3 k4 | a fisheye: polynomial in the angle from the axis (Kannala-Brandt) |

    Raises `ConfigError` for a wrong number of coefficients, or one that is not finite.
    """

    model: DistortionModel = "none"
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        allowed = _N_COEFFICIENTS[self.model]
        if len(self.coefficients) not in allowed:
            raise ConfigError(
                f"distortion {self.model} takes {' or '.join(map(str, allowed))} coefficients, "
                f"got {len(self.coefficients)}: {list(self.coefficients)}"
            )
        if not np.isfinite(self.coefficients).all():
            raise ConfigError(f"distortion coefficients must be finite, got {list(self.coefficients)}")

    @staticmethod
    def named(model: str, coefficients: Iterable[float]) -> Distortion:
        """With a model that a file names. Raises `ConfigError` naming the models there are."""
        for known in get_args(DistortionModel):
            if model == known:
                return Distortion(model=known, coefficients=tuple(map(float, coefficients)))
        there_are = ", ".join(get_args(DistortionModel))
        raise ConfigError(f"no distortion model {model!r}; there are: {there_are}")

    @property
    def is_none(self) -> bool:
        """Whether every ray stays where it is. (An equidistant lens bends rays even with zeros alone.)"""
        return self.model != "equidistant" and not any(self.coefficients)

    def distort(self, xy: Float[ndarray, "*points 2"]) -> Float[ndarray, "*points 2"]:
        """Where on the plane z = 1 the rays through `xy` appear."""
        if self.is_none:
            return xy
        if self.model == "equidistant":
            return _equidistant(xy, *self.coefficients)
        return _brown_conrady(xy, *self.coefficients)


@dataclass(frozen=True, kw_only=True)
class LensCamera:
    """A camera as it is built: a pinhole camera behind a lens."""

    intrinsics: CameraIntrinsics
    """Size, focal lengths and principal point [pixels] of the image as it is taken."""
    distortion: Distortion = Distortion()

    def project(self, xy: Float[ndarray, "*points 2"]) -> Float[ndarray, "*points 2"]:
        """Pixel coordinates (u, v) of the rays `(x, y, 1)`; pixel centres lie at integer + 0.5."""
        camera = self.intrinsics
        distorted = self.distortion.distort(xy)
        return distorted * np.array([camera.fx, camera.fy]) + np.array([camera.cx, camera.cy])

    def undistorted(self) -> CameraIntrinsics:
        """A pinhole camera of the same size and principal point all of whose pixels this camera has seen.

        Its focal lengths are this camera's, times the least factor (at least 1) for which its borders lie
        inside this camera's image. Raises `ConfigError` when the lens is not one that can be undone: when it
        folds rays over each other inside the image, or when no factor up to 8 will do.
        """
        if self.distortion.is_none:
            return self.intrinsics
        least, most = 1.0, _WIDEST_ZOOM
        if not self._sees_all_of(most):
            raise ConfigError(
                f"distortion {self.distortion.model} {list(self.distortion.coefficients)} leaves no usable "
                f"part of the image of {self.intrinsics}: calibrate the camera again"
            )
        if self._sees_all_of(least):
            most = least
        while most - least > 1e-4:
            middle = 0.5 * (least + most)
            least, most = (least, middle) if self._sees_all_of(middle) else (middle, most)
        pinhole = replace(self.intrinsics, fx=self.intrinsics.fx * most, fy=self.intrinsics.fy * most)
        self._refuse_folds(pinhole)
        return pinhole

    def _sees_all_of(self, zoom: float) -> bool:
        camera = self.intrinsics
        uv = self.project(_border_rays(camera, zoom))
        within = (uv >= 0.0) & (uv <= np.array([camera.width, camera.height]))
        return bool(within.all())

    def _refuse_folds(self, pinhole: CameraIntrinsics) -> None:
        """Along every line from the centre to the border, the distorted image must keep its order."""
        shares = np.linspace(0.0, 1.0, 33)[:, None, None]
        lines = shares * _border_rays(pinhole, 1.0)
        distorted = self.distortion.distort(lines)
        outward = np.sum(np.diff(distorted, axis=0) * np.diff(lines, axis=0), axis=-1)
        if not (outward > 0.0).all():
            raise ConfigError(
                f"distortion {self.distortion.model} {list(self.distortion.coefficients)} shows some rays "
                "twice inside the image: its coefficients hold for a smaller part of it; calibrate it again"
            )


def _border_rays(camera: CameraIntrinsics, zoom: float) -> Float[ndarray, "n 2"]:
    """Rays through the outermost pixel centres, `zoom` times as far from each other."""
    u = np.linspace(0.5, camera.width - 0.5, _BORDER_SAMPLES)
    v = np.linspace(0.5, camera.height - 0.5, _BORDER_SAMPLES)
    left, right = np.full_like(v, u[0]), np.full_like(v, u[-1])
    top, bottom = np.full_like(u, v[0]), np.full_like(u, v[-1])
    uv = np.concatenate([np.stack(side, axis=1) for side in ((u, top), (u, bottom), (left, v), (right, v))])
    return (uv - np.array([camera.cx, camera.cy])) / (zoom * np.array([camera.fx, camera.fy]))


def _brown_conrady(
    xy: Float[ndarray, "*points 2"],
    k1: float,
    k2: float,
    p1: float,
    p2: float,
    k3: float = 0.0,
    k4: float = 0.0,
    k5: float = 0.0,
    k6: float = 0.0,
) -> Float[ndarray, "*points 2"]:
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )


def _equidistant(
    xy: Float[ndarray, "*points 2"], k1: float, k2: float, k3: float, k4: float
) -> Float[ndarray, "*points 2"]:
    r = np.linalg.norm(xy, axis=-1, keepdims=True)
    theta = np.arctan(r)
    t2 = theta * theta
    distorted = theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    return xy * np.where(r > 1e-12, distorted / np.maximum(r, 1e-12), 1.0)
