"""What a level camera sees of given samples from a position, for every one of its headings."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from hgs_core.evaluation.observable import in_view_at_some_yaw
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.scene.ray_caster import RayCaster

N_YAWS: Final = 36
YAWS_RAD: Final = np.arange(N_YAWS) * (2 * np.pi / N_YAWS)
"""Headings that a camera may look at from a position: every 10 degrees."""


class Looks:
    """A camera of `intrinsics` and `range_m` (as z-depth), level at one height, before known samples."""

    def __init__(
        self,
        caster: RayCaster,
        samples_m: Float[ndarray, "n 3"],
        *,
        camera_height_m: float,
        intrinsics: CameraIntrinsics,
        range_m: float,
    ) -> None:
        self.samples_m = samples_m
        self._caster = caster
        self._height_m = camera_height_m
        self._intrinsics = intrinsics
        self._range_m = range_m

    def seen(
        self, position_m: Float[ndarray, " 2"], yaws_rad: Float[ndarray, " n_yaws"] = YAWS_RAD
    ) -> Bool[ndarray, "n_yaws n"]:
        """Which samples are inside the image, within range and not hidden, for each heading."""
        eye = np.array([*position_m, self._height_m])
        near = np.flatnonzero(
            in_view_at_some_yaw(self.samples_m, eye, intrinsics=self._intrinsics, range_m=self._range_m)
        )
        near = near[self._caster.visible(eye.astype(np.float32), self.samples_m[near].astype(np.float32))]
        seen = np.zeros((len(yaws_rad), len(self.samples_m)), dtype=bool)
        seen[:, near] = self._in_image(self.samples_m[near] - eye, yaws_rad)
        return seen

    def _in_image(
        self, offset: Float[ndarray, "n 3"], yaws_rad: Float[ndarray, " n_yaws"]
    ) -> Bool[ndarray, "n_yaws n"]:
        camera = self._intrinsics
        forward = np.outer(np.cos(yaws_rad), offset[:, 0]) + np.outer(np.sin(yaws_rad), offset[:, 1])
        right = np.outer(np.sin(yaws_rad), offset[:, 0]) - np.outer(np.cos(yaws_rad), offset[:, 1])
        half_width = min(camera.cx, camera.width - camera.cx) / camera.fx
        half_height = min(camera.cy, camera.height - camera.cy) / camera.fy
        return (
            (forward > 0)
            & (forward <= self._range_m)
            & (np.abs(right) <= half_width * forward)
            & (np.abs(offset[:, 2]) <= half_height * forward)
        )
