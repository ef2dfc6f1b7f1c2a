"""The keyframes of a finished run, opened from its folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframe_files import decode_depth, read_colour, read_depth
from hgs_core.mapping.keyframes import TrainingImage, halved_camera
from hgs_core.mapping.transforms import TRANSFORMS, Transforms, read_transforms
from hgs_core.native import kernels


class KeyframeArchive:
    """Poses in memory, images on disk until they are asked for. Reads only; nothing is cached."""

    def __init__(self, folder: Path, transforms: Transforms) -> None:
        self._folder = folder
        self._transforms = transforms

    @staticmethod
    def open(run_folder: Path) -> KeyframeArchive:
        """The keyframes that `transforms.json` in a run's folder names.

        Raises `MapError` when that file is missing (a run of an earlier version, or one that failed before
        its first frame) or damaged. Images are read later: `load` raises `MapError` for one that is gone.
        """
        return KeyframeArchive(run_folder, read_transforms(run_folder / TRANSFORMS))

    def __len__(self) -> int:
        return len(self._transforms.timestamps_s)

    @property
    def intrinsics(self) -> CameraIntrinsics:
        """The camera at full resolution."""
        return self._transforms.intrinsics

    @property
    def poses(self) -> SE3:
        """`T_world_camera` of all keyframes, batched."""
        return self._transforms.T_world_camera

    @property
    def timestamps_s(self) -> Float[ndarray, " n_keyframes"]:
        return self._transforms.timestamps_s

    def files(self, index: int) -> tuple[Path, Path]:
        """Where its colour and its depth lie."""
        names = self._transforms.colour_paths[index], self._transforms.depth_paths[index]
        return self._folder / names[0], self._folder / names[1]

    def load(self, index: int) -> TrainingImage:
        """A keyframe at full resolution.

        Depth was kept halved and smoothed. Each of its pixels covers the 2 x 2 that it came from, so that no
        depth between two surfaces is made up; the last row or column of an odd size has none.
        """
        camera, depth = self.intrinsics, self._halved_depth(index)
        depth_m: Float32[ndarray, "h w"] = np.zeros((camera.height, camera.width), np.float32)
        doubled = depth.repeat(2, axis=0).repeat(2, axis=1)
        depth_m[: doubled.shape[0], : doubled.shape[1]] = doubled
        return TrainingImage(
            rgb=self._colour(index), depth_m=depth_m, intrinsics=camera, T_world_camera=self.poses[index]
        )

    def load_halved(self, index: int) -> TrainingImage:
        """The image that the online mapper learnt from, but for the colour error of JPEG."""
        return TrainingImage(
            rgb=_halved(self._colour(index)),
            depth_m=self._halved_depth(index),
            intrinsics=halved_camera(self.intrinsics),
            T_world_camera=self.poses[index],
        )

    def _colour(self, index: int) -> UInt8[ndarray, "height width 3"]:
        path = self._folder / self._transforms.colour_paths[index]
        rgb = read_colour(path)
        if rgb.shape[:2] != (self.intrinsics.height, self.intrinsics.width):
            raise MapError(f"{path} has the size {rgb.shape[:2]}, which is not that of its camera")
        return rgb

    def _halved_depth(self, index: int) -> Float32[ndarray, "height width"]:
        path = self._folder / self._transforms.depth_paths[index]
        encoded = read_depth(path)
        halved = halved_camera(self.intrinsics)
        if encoded.shape != (halved.height, halved.width):
            raise MapError(f"{path} has the size {encoded.shape}, which is not half that of its camera")
        return decode_depth(encoded, self._transforms.depth_unit_m)


def _halved(rgb: UInt8[ndarray, "height width 3"]) -> UInt8[ndarray, "half_height half_width 3"]:
    """Mean of 2 x 2 pixels, rounded as the mapper rounds it."""
    height, width = rgb.shape[:2]
    halved = np.empty((height // 2, width // 2, 3), np.uint8)
    no_depth = np.zeros((height, width), np.float32)
    kernels.halve_frame(rgb, no_depth, 0.0, halved, np.empty(halved.shape[:2], np.float32))
    return halved
