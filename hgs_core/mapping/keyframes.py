"""Keyframes: halved images on disk, poses in memory."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from numpy import ndarray

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3

_DEPTH_UNIT_M = 1e-4
_NOTHING_IN_RANGE = np.uint16(65535)
_N_PROBES = 64
_OCCLUSION_MARGIN_M = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingImage:
    """A halved RGB-D image to optimise against; `depth_m` is smoothed, 0 / +inf as in `Frame`."""

    rgb: UInt8[ndarray, "height width 3"]
    depth_m: Float32[ndarray, "height width"]
    intrinsics: CameraIntrinsics
    T_world_camera: SE3

    @property
    def measured(self) -> Bool[ndarray, "height width"]:
        """Pixels with a depth."""
        return (self.depth_m > 0) & np.isfinite(self.depth_m)

    @property
    def farthest_m(self) -> float:
        """The largest depth that was measured; 0 if none was."""
        return float(np.max(self.depth_m, where=self.measured, initial=0.0))


class KeyframeStore:
    """All keyframes of a mission. Images live in files (1 MB each); memory holds poses and a few probes.

    Probes are surface points spread over a keyframe's image: two keyframes overlap when the probes of one
    fall into the image of the other.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._folder.mkdir(parents=True, exist_ok=True)
        self._poses: list[SE3] = []
        self._intrinsics: list[CameraIntrinsics] = []
        self._world_to_camera = np.zeros((0, 3, 4))
        self._positions_m = np.zeros((0, 3))

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def last_pose(self) -> SE3 | None:
        return self._poses[-1] if self._poses else None

    @property
    def poses(self) -> SE3:
        """`T_world_camera` of all keyframes, batched."""
        return SE3(
            rotation=np.stack([pose.rotation for pose in self._poses]),
            translation=np.stack([pose.translation for pose in self._poses]),
        )

    def add(self, image: TrainingImage) -> int:
        """Store a keyframe; returns its index."""
        index = len(self)
        depth = np.clip(image.depth_m / _DEPTH_UNIT_M + 0.5, 0, 65534)
        encoded = np.where(np.isinf(image.depth_m), _NOTHING_IN_RANGE, depth.astype(np.uint16))
        np.save(self._folder / f"{index:06d}_rgb.npy", image.rgb)
        np.save(self._folder / f"{index:06d}_depth.npy", encoded)
        self._poses.append(image.T_world_camera)
        self._intrinsics.append(image.intrinsics)
        inverse = image.T_world_camera.inverse()
        row = np.concatenate([inverse.rotation, inverse.translation[:, None]], axis=1)
        self._world_to_camera = np.concatenate([self._world_to_camera, row[None]])
        self._positions_m = np.concatenate([self._positions_m, image.T_world_camera.translation[None]])
        return index

    def load(self, index: int) -> TrainingImage:
        encoded = np.load(self._folder / f"{index:06d}_depth.npy")
        depth = encoded.astype(np.float32) * np.float32(_DEPTH_UNIT_M)
        depth[encoded == _NOTHING_IN_RANGE] = np.inf
        return TrainingImage(
            rgb=np.load(self._folder / f"{index:06d}_rgb.npy"),
            depth_m=depth,
            intrinsics=self._intrinsics[index],
            T_world_camera=self._poses[index],
        )

    def overlap(self, image: TrainingImage, *, range_m: float) -> Float[ndarray, " n_keyframes"]:
        """Share of `image`'s surface probes that each keyframe has in view within `range_m`."""
        probes = _surface_probes(image)
        if len(probes) == 0 or len(self) == 0:
            return np.zeros(len(self))
        camera = self._intrinsics[0]
        share = np.zeros(len(self))
        near = self._near(probes, range_m + _OCCLUSION_MARGIN_M)
        homogeneous = np.concatenate([probes, np.ones((len(probes), 1))], axis=1)
        points = homogeneous @ np.swapaxes(self._world_to_camera[near], 1, 2)
        z = points[..., 2]
        safe = np.where(z > 0.1, z, 1.0)
        u = camera.fx * points[..., 0] / safe + camera.cx
        v = camera.fy * points[..., 1] / safe + camera.cy
        seen = (z > 0.1) & (z < range_m + _OCCLUSION_MARGIN_M)
        seen &= (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        share[near] = seen.mean(axis=1)
        return share

    def _near(self, probes_m: Float[ndarray, "n 3"], depth_m: float) -> Int[ndarray, " n_near"]:
        """Keyframes that may have any of the probes in view: the only ones that cost anything."""
        camera = self._intrinsics[0]
        sideways = max(camera.cx, camera.width - camera.cx) / camera.fx
        upwards = max(camera.cy, camera.height - camera.cy) / camera.fy
        reach = depth_m * np.sqrt(1.0 + sideways**2 + upwards**2)
        apart = np.maximum(probes_m.min(axis=0) - self._positions_m, self._positions_m - probes_m.max(axis=0))
        return np.flatnonzero(np.all(apart <= reach, axis=1))

    def state(self) -> dict[str, Any]:
        """Poses and cameras; the images are files already."""
        matrices = [pose.as_matrix() for pose in self._poses]
        return {"poses": matrices, "intrinsics": list(self._intrinsics)}

    @staticmethod
    def restore(folder: Path, state: dict[str, Any]) -> KeyframeStore:
        store = KeyframeStore(folder)
        store._poses = [SE3.from_matrix(matrix) for matrix in state["poses"]]
        store._intrinsics = list(state["intrinsics"])
        rows = [pose.inverse() for pose in store._poses]
        store._world_to_camera = np.array(
            [np.concatenate([row.rotation, row.translation[:, None]], axis=1) for row in rows]
        ).reshape(-1, 3, 4)
        store._positions_m = np.array([pose.translation for pose in store._poses]).reshape(-1, 3)
        return store


def _surface_probes(image: TrainingImage) -> Float[ndarray, "n 3"]:
    height, width = image.depth_m.shape
    side = int(np.sqrt(_N_PROBES))
    rows = (np.arange(side) + 0.5) / side * height
    columns = (np.arange(side) + 0.5) / side * width
    grid_rows, grid_columns = np.meshgrid(rows.astype(int), columns.astype(int), indexing="ij")
    z = image.depth_m[grid_rows, grid_columns].ravel().astype(float)
    camera = image.intrinsics
    x = (grid_columns.ravel() + 0.5 - camera.cx) / camera.fx
    y = (grid_rows.ravel() + 0.5 - camera.cy) / camera.fy
    measured = (z > 0) & np.isfinite(z)
    points = np.stack([x * z, y * z, z], axis=1)[measured]
    return image.T_world_camera.apply(points)
