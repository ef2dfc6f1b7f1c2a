"""Keyframes: images on disk, poses in memory."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from numpy import ndarray

from hgs_core.errors import MapError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.keyframe_files import (
    colour_name,
    decode_depth,
    depth_name,
    depth_unit_m,
    encode_depth,
    write_colour,
    write_depth,
)
from hgs_core.mapping.transforms import Transforms, write_transforms
from hgs_core.sensing.frame import Frame

WORKING_FOLDER: Final = "working"
"""Of a keyframe store: what only a mission that goes on needs."""
_WORKING: Final = ("rgb", "depth")
_N_PROBES = 64
_OCCLUSION_MARGIN_M = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingImage:
    """An RGB-D image to optimise against; `depth_m` is smoothed, 0 / +inf as in `Frame`."""

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


def halved_camera(intrinsics: CameraIntrinsics) -> CameraIntrinsics:
    """The camera of a halved training image; an odd last row or column is left out.

    Splats are as wide in it as in the full image, or they would shrink to fit it and leave holes there.
    """
    return replace(
        intrinsics.scaled(0.5),
        width=intrinsics.width // 2,
        height=intrinsics.height // 2,
        low_pass_px2=intrinsics.low_pass_px2 / 4,
    )


class KeyframeStore:
    """All keyframes of a mission. Images live in files; memory holds poses and a few probes.

    For each keyframe the folder keeps the frame's full colour and the smoothed depth, compressed (0.5 MB),
    which are there to stay, and what the mapper draws again and again from, the halved image, as it is (1 MB,
    loaded in half a millisecond), which lies in `WORKING_FOLDER` and goes with the end of the mission.

    Probes are surface points spread over a keyframe's image: two keyframes overlap when the probes of one
    fall into the image of the other.
    """

    def __init__(self, folder: Path, *, range_m: float) -> None:
        """`range_m` is the farthest depth that frames hold: it decides the unit of the depth files."""
        self._folder = folder
        self._working = folder / WORKING_FOLDER
        self._working.mkdir(parents=True, exist_ok=True)
        self._range_m = range_m
        self._depth_unit_m = depth_unit_m(range_m)
        self._camera: CameraIntrinsics | None = None
        self._poses: list[SE3] = []
        self._timestamps_s: list[float] = []
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
            rotation=np.array([pose.rotation for pose in self._poses]).reshape(-1, 3, 3),
            translation=np.array([pose.translation for pose in self._poses]).reshape(-1, 3),
        )

    @property
    def inherited(self) -> list[SE3]:
        """`T_world_camera` of those that another run has taken, in order."""
        return [pose for pose, stamp in zip(self._poses, self._timestamps_s, strict=True) if stamp < 0]

    def add(self, image: TrainingImage, frame: Frame) -> int:
        """Store a keyframe, `image` being made from `frame`; returns its index.

        Raises `MapError` for a frame of another camera than the first one's.
        """
        if self._camera is None:
            self._camera = frame.intrinsics
        elif self._camera != frame.intrinsics:
            raise MapError(f"keyframes come from one camera, {self._camera}; got {frame.intrinsics}")
        index = len(self)
        encoded = encode_depth(image.depth_m, self._depth_unit_m)
        write_colour(self._folder / colour_name(index), frame.rgb)
        write_depth(self._folder / depth_name(index), encoded)
        np.save(self._working / f"{index:06d}_rgb.npy", image.rgb)
        np.save(self._working / f"{index:06d}_depth.npy", encoded)
        self._poses.append(image.T_world_camera)
        self._timestamps_s.append(frame.timestamp_s)
        self._index_pose(image.T_world_camera)
        return index

    def inherit(
        self, image: TrainingImage, camera: CameraIntrinsics, *, colour: Path, depth: Path, timestamp_s: float
    ) -> None:
        """Store a keyframe that another run kept: its halved `image`, the `camera` at full resolution, and
        its two files, which are shared with that run where the disk allows."""
        self._camera = camera
        index = len(self)
        for given, name in ((colour, colour_name(index)), (depth, depth_name(index))):
            _share(given, self._folder / name)
        np.save(self._working / f"{index:06d}_rgb.npy", image.rgb)
        np.save(self._working / f"{index:06d}_depth.npy", encode_depth(image.depth_m, self._depth_unit_m))
        self._poses.append(image.T_world_camera)
        self._timestamps_s.append(timestamp_s)
        self._index_pose(image.T_world_camera)

    def correct(self, poses: Mapping[int, SE3]) -> None:
        """Put keyframes at other poses (`T_world_camera`)."""
        for index, pose in poses.items():
            self._poses[index] = pose
            self._world_to_camera[index] = _world_to_camera(pose)
            self._positions_m[index] = pose.translation

    def load(self, index: int) -> TrainingImage:
        """The halved image of a keyframe, from the working files."""
        encoded = np.load(self._working / f"{index:06d}_depth.npy")
        return TrainingImage(
            rgb=np.load(self._working / f"{index:06d}_rgb.npy"),
            depth_m=decode_depth(encoded, self._depth_unit_m),
            intrinsics=self._halved_camera,
            T_world_camera=self._poses[index],
        )

    def write_transforms(self, path: Path) -> None:
        """Describe the stored images in `path`, which must lie beside or above their folder.

        Raises `MapError` when there are none.
        """
        if self._camera is None:
            raise MapError("no keyframe has been stored: there is nothing to describe")
        below = self._folder.relative_to(path.parent)
        names = range(len(self))
        transforms = Transforms(
            intrinsics=self._camera,
            depth_unit_m=self._depth_unit_m,
            T_world_camera=self.poses,
            timestamps_s=np.array(self._timestamps_s),
            colour_paths=tuple((below / colour_name(index)).as_posix() for index in names),
            depth_paths=tuple((below / depth_name(index)).as_posix() for index in names),
        )
        write_transforms(transforms, path)

    def files(self) -> list[Path]:
        """Everything that lies on the disk of all keyframes, working files included."""
        names = (
            (colour_name(k), depth_name(k), *(f"{WORKING_FOLDER}/{k:06d}_{kind}.npy" for kind in _WORKING))
            for k in range(len(self))
        )
        return [self._folder / name for of_one in names for name in of_one]

    def overlap(self, image: TrainingImage, *, range_m: float) -> Float[ndarray, " n_keyframes"]:
        """Share of `image`'s surface probes that each keyframe has in view within `range_m`."""
        probes = _surface_probes(image)
        if len(probes) == 0 or len(self) == 0:
            return np.zeros(len(self))
        camera = self._halved_camera
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
        camera = self._halved_camera
        sideways = max(camera.cx, camera.width - camera.cx) / camera.fx
        upwards = max(camera.cy, camera.height - camera.cy) / camera.fy
        reach = depth_m * np.sqrt(1.0 + sideways**2 + upwards**2)
        apart = np.maximum(probes_m.min(axis=0) - self._positions_m, self._positions_m - probes_m.max(axis=0))
        return np.flatnonzero(np.all(apart <= reach, axis=1))

    def state(self) -> dict[str, Any]:
        """Camera, poses and times; the images are files already."""
        return {
            "camera": None if self._camera is None else asdict(self._camera),
            "range_m": self._range_m,
            "poses": self.poses.as_matrix(),
            "world_to_camera": self._world_to_camera,
            "timestamps_s": np.array(self._timestamps_s),
        }

    @staticmethod
    def restore(folder: Path, state: dict[str, Any]) -> KeyframeStore:
        store = KeyframeStore(folder, range_m=state["range_m"])
        camera = state["camera"]
        store._camera = None if camera is None else CameraIntrinsics(**camera)
        store._poses = [SE3.from_matrix(matrix.copy()) for matrix in state["poses"]]
        store._timestamps_s = [float(stamp) for stamp in state["timestamps_s"]]
        # Not worked out again from the poses: the last digits of an inverse depend on how its array lies.
        store._world_to_camera = np.array(state["world_to_camera"])
        store._positions_m = state["poses"][:, :3, 3].copy()
        return store

    @property
    def _halved_camera(self) -> CameraIntrinsics:
        if self._camera is None:
            raise MapError("no keyframe has been stored")
        return halved_camera(self._camera)

    def _index_pose(self, pose: SE3) -> None:
        self._world_to_camera = np.concatenate([self._world_to_camera, _world_to_camera(pose)[None]])
        self._positions_m = np.concatenate([self._positions_m, pose.translation[None]])


def _world_to_camera(pose: SE3) -> Float[ndarray, "3 4"]:
    inverse = pose.inverse()
    return np.concatenate([inverse.rotation, inverse.translation[:, None]], axis=1)


def _share(given: Path, wanted: Path) -> None:
    """Give a file that never changes a second name; a copy where the file system cannot."""
    wanted.unlink(missing_ok=True)
    try:
        os.link(given, wanted)
    except OSError:
        shutil.copyfile(given, wanted)


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
