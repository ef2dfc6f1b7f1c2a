"""Images of one camera as another, at the same place and with the same axes, would have taken them."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from numpy import ndarray
from scipy import sparse

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import LensCamera


class PixelLookup:
    """For each pixel of a pinhole camera, where in the images of `source` its ray lies; worked out once.

    Both cameras have one optical centre and one orientation, so z-depths stay what they are.
    """

    def __init__(self, target: CameraIntrinsics, source: LensCamera) -> None:
        self._target = target
        self._source = source

    @property
    def changes_nothing(self) -> bool:
        """Whether both cameras take the same image."""
        theirs, ours = self._source.intrinsics, self._target
        same = (theirs.width, theirs.height, theirs.fx, theirs.fy, theirs.cx, theirs.cy) == (
            *(ours.width, ours.height, ours.fx, ours.fy, ours.cx, ours.cy),
        )
        return same and self._source.distortion.is_none

    def nearest(self, depth_m: Float32[ndarray, "height width"]) -> Float32[ndarray, "rows columns"]:
        """The depth of the nearest pixel: no depth between two surfaces is made up. 0 (no return) outside."""
        if self.changes_nothing:
            return depth_m
        index, inside = self._nearest
        found: Float32[ndarray, " n"] = np.where(inside, depth_m.reshape(-1)[index], np.float32(0.0))
        return found.reshape(self._target.height, self._target.width)

    def bilinear(self, rgb: UInt8[ndarray, "height width 3"]) -> UInt8[ndarray, "rows columns 3"]:
        """Colours, interpolated between the four pixels around each place; black outside."""
        if self.changes_nothing:
            return rgb
        mixed = self._mixing @ rgb.reshape(-1, 3).astype(np.float32)
        levels: UInt8[ndarray, "n 3"] = (mixed + np.float32(0.5)).astype(np.uint8)
        return levels.reshape(self._target.height, self._target.width, 3)

    @property
    def _places(self) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"]]:
        """Pixel coordinates in the source, and which of them lie in its image."""
        source = self._source.intrinsics
        uv = self._source.project(self._target.rays()[..., :2]).reshape(-1, 2)
        return uv, np.all((uv >= 0.0) & (uv < np.array([source.width, source.height])), axis=1)

    @cached_property
    def _nearest(self) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
        uv, inside = self._places
        column, row = np.floor(uv[:, 0]), np.floor(uv[:, 1])
        index = np.where(inside, row * self._source.intrinsics.width + column, 0)
        return index.astype(np.int64), inside

    @cached_property
    def _mixing(self) -> sparse.csr_array:
        """Each row of this matrix holds the shares of four source pixels in one target pixel."""
        width, height = self._source.intrinsics.width, self._source.intrinsics.height
        uv, inside = self._places
        u = np.clip(uv[:, 0] - 0.5, 0.0, width - 1.0)
        v = np.clip(uv[:, 1] - 0.5, 0.0, height - 1.0)
        left, top = np.minimum(u.astype(np.int64), width - 1), np.minimum(v.astype(np.int64), height - 1)
        right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
        along, down = u - left, v - top
        columns = np.stack(
            [top * width + left, top * width + right, bottom * width + left, bottom * width + right], axis=1
        )
        shares = np.stack(
            [(1 - along) * (1 - down), along * (1 - down), (1 - along) * down, along * down], axis=1
        )
        shares[~inside] = 0.0
        starts = np.arange(0, 4 * len(uv) + 1, 4)
        return sparse.csr_array(
            (shares.astype(np.float32).reshape(-1), columns.reshape(-1), starts),
            shape=(len(uv), width * height),
        )
