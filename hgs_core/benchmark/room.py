"""The rooms that benchmarks measure on: furnished, evenly covered with Gaussians, the same at every call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.gaussians.gaussian_map import CENTRE, LOG_RADIUS, LOGIT_OPACITY, RGB, GaussianMap
from hgs_core.gaussians.place_order import place_order
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

RENDERING_ROOM_M: Final = (7.0, 6.0, 2.8)
"""Where rendering is measured."""
PLANNING_ROOM_M: Final = (12.0, 12.0, 3.0)
"""Where planning is measured."""

RADIUS_OVER_SPACING: Final = 0.55
OPACITY: Final = 0.9
"""With this radius an even cover's mean optical depth is 1.7, as measured on maps of whole missions."""

_FURNITURE_PER_M2: Final = 0.2
_CAMERA_AT: Final = 0.15
_FURNITURE_FROM: Final = 0.35
"""As shares of the room's edges: the camera's corner stays free."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchmarkRoom:
    """A room with its lower corner at the origin."""

    size_m: tuple[float, float, float]
    gaussians: GaussianMap
    furniture: Float[ndarray, "n 6"]
    """Boxes on the floor: lower and upper corners [m]."""

    @staticmethod
    def furnished(size_m: tuple[float, float, float], n_gaussians: int) -> BenchmarkRoom:
        """`n_gaussians` spread evenly over the walls, floor, ceiling and boxes."""
        rng = np.random.default_rng(0)
        furniture = _furniture(size_m, rng)
        boxes = np.concatenate([[[0.0, 0.0, 0.0, *size_m]], furniture])
        faces = np.concatenate([_faces(box) for box in boxes])
        areas = np.linalg.norm(np.cross(faces[:, 1], faces[:, 2]), axis=1)
        points = np.concatenate(
            [_spread(face, n) for face, n in zip(faces, _shares(areas, n_gaussians).tolist(), strict=True)]
        )
        spacing_m = float(np.sqrt(areas.sum() / n_gaussians))
        parameters = np.empty((n_gaussians, 8), np.float32)
        parameters[:, CENTRE] = points
        parameters[:, RGB] = _colours(points, rng)
        parameters[:, LOG_RADIUS] = np.log(RADIUS_OVER_SPACING * spacing_m) + rng.normal(0, 0.3, n_gaussians)
        parameters[:, LOGIT_OPACITY] = np.log(OPACITY / (1 - OPACITY))
        gaussians = GaussianMap()
        gaussians.append(parameters[place_order(parameters[:, CENTRE])], anchor_keyframe=0)
        return BenchmarkRoom(size_m=size_m, gaussians=gaussians, furniture=furniture)

    def view(self, width: int, height: int) -> tuple[CameraIntrinsics, SE3]:
        """A camera with 90 degrees of view that looks level across the room from near a corner."""
        camera = CameraIntrinsics.centred(width, height, width / 2)
        x_m, y_m = _CAMERA_AT * np.array(self.size_m[:2])
        return camera, level_camera_pose(x_m, y_m, 1.2, float(np.arctan2(self.size_m[1], self.size_m[0])))

    def snapshot(self) -> MapSnapshot:
        """Both maps, as if most of the room had been seen: a quarter of it is unobserved."""
        margin = 0.3
        upper = np.array(self.size_m)
        voxels = VoxelMap(VoxelConfig(), region=Box(lower_m=np.zeros(3) - margin, upper_m=upper + margin))
        occupied, _ = voxels.index_of(self.gaussians.centres_m.astype(np.float64))
        inside, _ = voxels.index_of(np.stack([np.zeros(3) + 0.05, upper - 0.05]))
        voxels.states[tuple(slice(a, b + 1) for a, b in inside.T)] = VoxelState.FREE
        voxels.states[occupied[:, 0], occupied[:, 1], occupied[:, 2]] = VoxelState.OCCUPIED
        quarter = voxels.states[voxels.states.shape[0] // 2 :, voxels.states.shape[1] // 2 :]
        quarter[quarter == VoxelState.FREE] = VoxelState.UNOBSERVED
        rng = np.random.default_rng(1)
        size = self.gaussians.size
        self.gaussians.information[:size] = rng.gamma(2.0, 10.0, (size, 8))
        return MapSnapshot(gaussians=self.gaussians, voxels=voxels, version=1, timestamp_s=0.0)

    def viewpoints_m(self, n: int) -> Float[ndarray, "n 3"]:
        """Camera positions spread over the room."""
        low, high = np.full(2, 0.6), np.array(self.size_m[:2]) - 0.6
        at = np.random.default_rng(2).uniform(low, high, (n, 2))
        return np.column_stack([at, np.full(n, 1.0)])


def _furniture(size_m: tuple[float, float, float], rng: np.random.Generator) -> Float[ndarray, "n 6"]:
    n = round(_FURNITURE_PER_M2 * size_m[0] * size_m[1])
    floor = np.array(size_m[:2])
    low = rng.uniform(_FURNITURE_FROM * floor, 0.8 * floor, (n, 2))
    high = np.minimum(low + rng.uniform(0.4, 1.2, (n, 2)), 0.98 * floor)
    return np.column_stack([low, np.zeros(n), high, rng.uniform(0.4, 1.4, n)])


def _faces(box: Float[ndarray, " 6"]) -> Float[ndarray, "6 3 3"]:
    """Corner and two edges of each face."""
    lower, edges = box[:3], np.diag(box[3:] - box[:3])
    faces = []
    for axis in range(3):
        first, second = edges[(axis + 1) % 3], edges[(axis + 2) % 3]
        faces += [(lower, first, second), (lower + edges[axis], first, second)]
    return np.array(faces)


def _shares(weights: Float[ndarray, " n"], total: int) -> Int[ndarray, " n"]:
    """`total` split in proportion, by largest remainders."""
    exact = weights / weights.sum() * total
    shares = np.floor(exact).astype(np.int64)
    shares[np.argsort(shares - exact)[: total - shares.sum()]] += 1
    return shares


def _spread(face: Float[ndarray, "3 3"], n: int) -> Float[ndarray, "n 3"]:
    """Points spread evenly over a face: the additive recurrence of the plastic number."""
    along = (0.5 + np.outer(np.arange(n), [0.7548776662466927, 0.5698402909980532])) % 1.0
    points: Float[ndarray, "n 3"] = face[0] + along[:, :1] * face[1] + along[:, 1:] * face[2]
    return points


def _colours(points_m: Float[ndarray, "n 3"], rng: np.random.Generator) -> Float[ndarray, "n 3"]:
    """Stripes of several widths and a little noise: something to optimise."""
    directions = rng.normal(size=(3, 3)) * np.array([[4.0], [11.0], [29.0]])
    waves = np.sin(points_m @ directions.T) @ rng.uniform(0.05, 0.15, (3, 3))
    return np.clip(0.5 + waves + rng.normal(0, 0.02, points_m.shape), 0.0, 1.0)
