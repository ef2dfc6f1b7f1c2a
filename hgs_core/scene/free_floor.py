"""Where on the floor a robot can stand, and where it should start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32
from numpy import ndarray
from scipy import ndimage

from hgs_core.errors import SceneError
from hgs_core.geometry.boxes import Box
from hgs_core.robot.robot import STEP_HEIGHT_M
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.ray_caster import RayCaster

_FLOOR_BELOW_M = 0.15
_CEILING_WITHIN_M = 12.0
_START_MARGIN_M = 0.05
_MIN_FREE_AREA_M2 = 1.0


@dataclass(frozen=True, kw_only=True)
class StartPose:
    """Where a mission begins: robot axis on the floor, heading counter-clockwise from world +x."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeFloor:
    """A raster of the floor; cell `(i, j)` is centred at `origin_m + (i, j) * cell_m`.

    `clearance_m` is the distance from the cell's centre to the nearest obstacle of the body (exact) or
    missing floor (to one cell); 0 where there is no floor. Floor is a surface between 15 cm below and 5 cm
    above z = 0.
    """

    origin_m: Float[ndarray, " 2"]
    cell_m: float
    clearance_m: Float32[ndarray, "nx ny"]

    @staticmethod
    def of(caster: RayCaster, obstacles: BodyObstacles, cell_m: float = 0.1) -> FreeFloor:
        bounds = caster.mesh.bounds()
        shape = np.ceil(bounds.size_m[:2] / cell_m).astype(int)
        origin = bounds.lower_m[:2] + cell_m / 2
        grid = origin + np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1) * cell_m
        has_floor = floor_under(caster, grid, obstacles.height_m)
        to_edge = ndimage.distance_transform_edt(np.pad(has_floor, 1))[1:-1, 1:-1] * cell_m
        clearance = np.minimum(obstacles.clearance_m(grid), to_edge).astype(np.float32)
        return FreeFloor(origin_m=origin, cell_m=cell_m, clearance_m=clearance)

    @property
    def cells_m(self) -> Float[ndarray, "nx ny 2"]:
        """Centres of all cells."""
        index = np.stack(np.meshgrid(*map(np.arange, self.clearance_m.shape), indexing="ij"), axis=-1)
        return self.origin_m + index * self.cell_m

    def reachable(self, x_m: float, y_m: float, radius_m: float) -> Bool[ndarray, "nx ny"]:
        """Cells that a disc of `radius_m` reaches from `(x_m, y_m)` in steps between neighbouring cells."""
        free = self.clearance_m > radius_m
        regions, _ = ndimage.label(free)
        i, j = np.rint((np.array([x_m, y_m]) - self.origin_m) / self.cell_m).astype(int)
        lower = np.maximum([i - 1, j - 1], 0)
        near = regions[lower[0] : i + 2, lower[1] : j + 2]
        own = np.unique(near[near > 0])
        mask: Bool[ndarray, "nx ny"] = np.isin(regions, own)
        return mask


def floor_under(
    caster: RayCaster, points: Float[ndarray, "*points 2"], height_m: float
) -> Bool[ndarray, "*points"]:
    """Whether the first surface below `height_m` at each point is floor."""
    origins = np.concatenate([points, np.full((*points.shape[:-1], 1), height_m)], axis=-1)
    z = height_m - caster.cast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape))
    on_floor: Bool[ndarray, "*points"] = (z >= -_FLOOR_BELOW_M) & (z <= STEP_HEIGHT_M)
    return on_floor


def start_fault(
    caster: RayCaster, obstacles: BodyObstacles, x_m: float, y_m: float, radius_m: float
) -> str | None:
    """Why a robot of `radius_m` cannot start at `(x_m, y_m)`, or None where it can."""
    point = np.array([x_m, y_m])
    clearance = float(obstacles.clearance_m(point))
    if clearance <= radius_m:
        return f"an obstacle is {clearance:.2f} m away, the robot's radius is {radius_m:.2f} m"
    around = point + radius_m * _directions(8)
    if not bool(np.all(floor_under(caster, np.vstack([point, around]), obstacles.height_m))):
        return "there is no floor under the whole robot"
    return None


def choose_start(caster: RayCaster, radius_m: float, height_m: float) -> StartPose:
    """The pose farthest from obstacles in the largest free area, heading along the longest free line.

    Area under a ceiling counts before open ground. Raises `SceneError` when less than 1 m2 is free.
    """
    space = _FreeSpace.of(caster, radius_m, height_m)
    floor, area_m2 = space.floor, space.area_m2
    if area_m2 < _MIN_FREE_AREA_M2:
        raise SceneError(_no_free_floor(caster.mesh.bounds(), floor, area_m2, radius_m, height_m))
    at = np.unravel_index(np.argmax(np.where(space.largest, floor.clearance_m, -1.0)), space.largest.shape)
    x, y = floor.cells_m[at]
    directions = np.concatenate([_directions(36), np.zeros((36, 1))], axis=-1)
    reach = caster.cast(np.broadcast_to([x, y, height_m], directions.shape), directions)
    best = int(np.argmax(np.minimum(reach, 100.0)))
    return StartPose(
        x_m=float(x), y_m=float(y), yaw_rad=float(np.arctan2(directions[best, 1], directions[best, 0]))
    )


def free_area_m2(caster: RayCaster, radius_m: float, height_m: float) -> float:
    """The largest area of floor at z = 0 that a robot can drive on without a break [m2]."""
    return _FreeSpace.of(caster, radius_m, height_m).area_m2


@dataclass(frozen=True, kw_only=True, eq=False)
class _FreeSpace:
    floor: FreeFloor
    largest: Bool[ndarray, "nx ny"]
    """The largest connected region where the robot fits; of that, only what is under a ceiling if anything of
    the scene is."""

    @staticmethod
    def of(caster: RayCaster, radius_m: float, height_m: float) -> _FreeSpace:
        floor = FreeFloor.of(caster, BodyObstacles(caster.mesh, height_m))
        free = floor.clearance_m > radius_m + _START_MARGIN_M
        regions, n_regions = ndimage.label(free)
        covered = free.copy()
        origins = np.concatenate([floor.cells_m[free], np.full((int(free.sum()), 1), height_m)], axis=-1)
        up = caster.cast(origins, np.broadcast_to([0.0, 0.0, 1.0], origins.shape))
        covered[free] = up < _CEILING_WITHIN_M
        indoors = covered if covered.any() else free
        if n_regions == 0:
            return _FreeSpace(floor=floor, largest=free)
        areas = ndimage.sum_labels(indoors, regions, np.arange(1, n_regions + 1))
        return _FreeSpace(floor=floor, largest=(regions == 1 + int(np.argmax(areas))) & indoors)

    @property
    def area_m2(self) -> float:
        return int(np.count_nonzero(self.largest)) * self.floor.cell_m**2


def _directions(count: int) -> Float[ndarray, "count 2"]:
    angles = np.arange(count) * (2 * np.pi / count)
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def _no_free_floor(bounds: Box, floor: FreeFloor, area_m2: float, radius_m: float, height_m: float) -> str:
    has_floor = int(np.count_nonzero(floor.clearance_m > 0))
    return (
        f"no free floor for a robot of radius {radius_m:g} m and height {height_m:g} m: the scene spans "
        f"{' x '.join(f'{size:.2f}' for size in bounds.size_m)} m with z from {bounds.lower_m[2]:.2f} to "
        f"{bounds.upper_m[2]:.2f} m, {has_floor * floor.cell_m**2:.1f} m2 of floor near z = 0, and "
        f"the largest area free of obstacles has {area_m2:.1f} m2 ({_MIN_FREE_AREA_M2:g} m2 needed). "
        "Check scene.scale, scene.up_axis and scene.floor_z_m, or use a smaller robot."
    )
