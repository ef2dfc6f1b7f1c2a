"""Where the robot may stand and drive: a 2-D grid at voxel resolution, from the voxel map alone.

**Traversable.** The *body column* of a cell is its voxels with centres in `(clearance_below_m, height]`. A
cell is traversable when no voxel of its column is occupied and at least one has been seen free, by the planar
scanner (0.15 m) or the camera. Everything else is *blocked*: occupied, unseen, outside the map. So is what
the Gaussian map shows between the robot's step height and the column (sills, feet: see `low_obstacles`),
tips that it shows beside occupied cells, where a robot would touch them, what the robot has touched, and what
the operator forbids.

**Clearance.** The robot is a disc. Its centre keeps at least its radius from the *box* of every blocked cell:
exact point-to-box distances, both at cell centres and along straight segments. Cells nearer than
`preferred_clearance_m` cost more, so that paths keep to the middle where there is room.

**What low overhangs near the start can still do.** A level camera at 1.0 m with +-29.5 degrees of vertical
view sees nothing lower than `1.0 m - 0.57 d` at distance `d`; the scanner sees 0.15 m only. Something that
begins above the scanner's plane and ends below that line (a bench or a low table on thin legs beside the
start) is in neither's view: its cells are traversable by the rule above, and a robot that starts within about
1.5 m of it can touch it. Two things keep this rare. Cells whose surroundings still hold unobserved column
voxels cost more (`unobserved_weight`), so paths prefer what the camera has looked at; and anything 1.8 m or
farther away is seen down to the floor before the robot comes near it. Nothing short of another sensor removes
the rest.

**The robot's own place.** Unseen cells under the footprint count as free: the robot stands there. Occupied
ones do not: when a new obstacle shows up closer than the radius, `path_search` lets the robot leave by the
shortest way out, never towards the obstacle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32
from numpy import ndarray
from pydantic import Field
from scipy.ndimage import uniform_filter

from hgs_core.config.base import StrictConfig
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.native import kernels
from hgs_core.planning.low_obstacles import are_surfaces, low_surface_counts, tips_in_the_way
from hgs_core.robot.robot import RobotConfig
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState

SEGMENT_STEP = 0.25
"""Spacing of clearance samples along a segment, in cells: 2.5 cm at 0.1 m."""


class NavigationConfig(StrictConfig):
    """What counts as passable, and what a path prefers."""

    clearance_below_m: float = Field(0.1, ge=0)
    """The body column begins above this height [m]: lower things are driven over, and the floor is not an
    obstacle."""
    margin_m: float = Field(0.02, ge=0)
    """Kept beyond the radius wherever the room allows it [m]."""
    preferred_clearance_m: float = Field(0.45, gt=0)
    """Below this distance from the centre to anything blocked, driving costs more [m]."""
    clearance_weight: float = Field(3.0, ge=0)
    """Extra cost per metre at the least clearance, falling linearly to 0 at `preferred_clearance_m`."""
    unobserved_weight: float = Field(3.0, ge=0)
    """Extra cost per metre where the columns under the footprint are wholly unobserved, in proportion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NavigationGrid:
    """Traversability of the floor. Cell `(i, j)` covers `lower_m + [i, i + 1) x [j, j + 1)` times
    `size_m`."""

    lower_m: Float[ndarray, " 2"]
    size_m: float
    blocked: Bool[ndarray, "nx ny"]
    clearance_m: Float32[ndarray, "nx ny"]
    """From the cell's centre to the nearest blocked box, capped a little above `preferred_clearance_m`."""
    soft_cost: Float32[ndarray, "nx ny"]
    """Cost per metre, at least 1, finite everywhere."""
    cost: Float32[ndarray, "nx ny"]
    """`soft_cost` where the robot's centre may be (clearance of at least the radius), +inf elsewhere."""
    radius_m: float
    margin_m: float
    clearance_cap_m: float

    @property
    def shape(self) -> tuple[int, int]:
        return self.blocked.shape[0], self.blocked.shape[1]

    @cached_property
    def clearance_cells(self) -> Float32[ndarray, "nx ny"]:
        """`clearance_m` in cells."""
        cells: Float32[ndarray, "nx ny"] = self.clearance_m / np.float32(self.size_m)
        return cells

    @property
    def passable(self) -> Bool[ndarray, "nx ny"]:
        passable: Bool[ndarray, "nx ny"] = np.isfinite(self.cost)
        return passable

    def cells_of(self, points_m: Float[ndarray, "n 2"]) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
        """Flat cell indices of points, and which lie inside (the others get index 0)."""
        ij = np.floor((points_m - self.lower_m) / self.size_m).astype(np.int64)
        inside: Bool[ndarray, " n"] = np.all((ij >= 0) & (ij < np.array(self.shape)), axis=1)
        return np.where(inside, ij[:, 0] * self.shape[1] + ij[:, 1], 0), inside

    def centres_m(self, cells: Int[ndarray, " n"]) -> Float[ndarray, "n 2"]:
        """Centres of flat cells."""
        ij = np.stack([cells // self.shape[1], cells % self.shape[1]], axis=1)
        centres: Float[ndarray, "n 2"] = self.lower_m + (ij + 0.5) * self.size_m
        return centres

    def cells_within(
        self, flags: Bool[ndarray, "nx ny"], point_m: Float[ndarray, " 2"], radius_m: float
    ) -> Int[ndarray, " n"]:
        """Flagged cells (flat, ascending) with centres at most so far from a point."""
        cells = self.cells_between(flags, point_m - radius_m, point_m + radius_m)
        away = self.centres_m(cells) - point_m
        return cells[away[:, 0] ** 2 + away[:, 1] ** 2 <= radius_m**2]

    def cells_between(
        self, flags: Bool[ndarray, "nx ny"], low_m: Float[ndarray, " 2"], high_m: Float[ndarray, " 2"]
    ) -> Int[ndarray, " n"]:
        """Flagged cells (flat, ascending) with centres in the rectangle `low_m <= centre < high_m`, or a
        little outside."""
        first = np.maximum(np.floor((low_m - self.lower_m) / self.size_m).astype(np.int64), 0)
        last = np.maximum(np.floor((high_m - self.lower_m) / self.size_m).astype(np.int64) + 1, 0)
        i, j = np.nonzero(flags[first[0] : last[0], first[1] : last[1]])
        cells: Int[ndarray, " n"] = (i + first[0]) * self.shape[1] + j + first[1]
        return cells

    def check_segments(
        self, starts_m: Float[ndarray, "n 2"], ends_m: Float[ndarray, "n 2"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Least clearance [m] (capped) and cost of straight segments."""
        segments = np.concatenate([starts_m - self.lower_m, ends_m - self.lower_m], axis=1) / self.size_m
        least, cost = kernels.grid_segments(
            self.blocked.view(np.uint8),
            self.clearance_cells,
            self.soft_cost,
            np.ascontiguousarray(segments, dtype=np.float64),
            SEGMENT_STEP,
            self.clearance_cap_m / self.size_m,
        )
        return least * self.size_m, cost * self.size_m

    def changed_along(
        self,
        before: NavigationGrid,
        starts_m: Float[ndarray, "n 2"],
        ends_m: Float[ndarray, "n 2"],
    ) -> Bool[ndarray, " n"]:
        """Segments whose clearance or cost may not be what they were on an earlier grid."""
        if before.shape != self.shape or np.any(before.lower_m != self.lower_m):
            return np.ones(len(starts_m), bool)
        changed = (self.blocked != before.blocked) | (self.soft_cost != before.soft_cost)
        i, j = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
        if not len(i):
            return np.zeros(len(starts_m), bool)
        # What is blocked bears on the clearance of segments up to the cap away.
        low = self.lower_m + np.array([i[0], j[0]]) * self.size_m - self.clearance_cap_m - self.size_m
        high = self.lower_m + np.array([i[-1], j[-1]]) * self.size_m + self.clearance_cap_m + 2 * self.size_m
        along: Bool[ndarray, " n"] = np.all(
            (np.minimum(starts_m, ends_m) <= high) & (np.maximum(starts_m, ends_m) >= low), axis=1
        )
        return along

    def straighten(self, points_m: Float[ndarray, "n 2"], cost_factor: float) -> Int32[ndarray, " n_kept"]:
        """Indices of a polyline's points that are left when straight lines replace runs of it.

        A line keeps the radius and margin clear (or what the run itself keeps, where the run is tighter) and
        costs at most `cost_factor` times as much as the run.
        """
        return kernels.grid_straighten(
            self.blocked.view(np.uint8),
            self.clearance_cells,
            self.soft_cost,
            np.ascontiguousarray((points_m - self.lower_m) / self.size_m, dtype=np.float64),
            SEGMENT_STEP,
            self.clearance_cap_m / self.size_m,
            (self.radius_m + self.margin_m) / self.size_m,
            cost_factor,
        )

    def path_clearance_m(self, positions_m: Float[ndarray, "n 2"]) -> Float[ndarray, " n_segments"]:
        """Least clearance of each segment of a polyline (of the point itself, where there is only one)."""
        starts = positions_m[:-1] if len(positions_m) > 1 else positions_m
        ends = positions_m[1:] if len(positions_m) > 1 else positions_m
        return self.check_segments(starts, ends)[0]


def build_navigation_grid(
    voxels: VoxelMap,
    config: NavigationConfig,
    robot: RobotConfig,
    *,
    robot_xy_m: Float[ndarray, " 2"] | None,
    around_m: Float[ndarray, "n 2"] | None = None,
    gaussians: GaussianMap | None = None,
    touched_m: Float[ndarray, "n_touched 2"] | None = None,
    forbidden: Bool[ndarray, "n_columns_x n_columns_y"] | None = None,
) -> NavigationGrid:
    """The grid of the whole map, or, with `around_m`, of the part that can bear on a path through those
    points.

    `robot_xy_m` is where the robot stands (its footprint counts as seen); `None` for no robot. With
    `gaussians`, what they show above the step height blocks too; so does every cell of `touched_m`, and every
    `forbidden` column of the map.
    """
    size = voxels.config.size_m
    lower = np.asarray(voxels.lower_m(), dtype=np.float64)
    nx, ny, nz = voxels.states.shape
    centres_z = lower[2] + (np.arange(nz) + 0.5) * size
    tolerance = 1e-6 * size
    column = np.flatnonzero(
        (centres_z > config.clearance_below_m + tolerance) & (centres_z <= robot.height_m + tolerance)
    )
    low_k, high_k = (int(column[0]), int(column[-1]) + 1) if len(column) else (0, 0)
    cap = max(config.preferred_clearance_m, robot.radius_m + config.margin_m) + size
    low_i = low_j = 0
    if around_m is not None:
        reach = clearance_reach_m(cap, robot, size)
        low = np.floor((around_m.min(axis=0) - reach - lower[:2]) / size).astype(int)
        high = np.ceil((around_m.max(axis=0) + reach - lower[:2]) / size).astype(int)
        low_i, low_j = int(np.clip(low[0], 0, nx - 1)), int(np.clip(low[1], 0, ny - 1))
        nx, ny = int(np.clip(high[0], low_i + 1, nx)), int(np.clip(high[1], low_j + 1, ny))
    counts = voxels.count_in_columns((low_i, low_j, low_k), (nx, ny, high_k))
    lower_xy = lower[:2] + np.array([low_i, low_j]) * size
    occupied = counts[..., VoxelState.OCCUPIED] > 0
    free = counts[..., VoxelState.FREE] > 0
    if robot_xy_m is not None:
        free |= _footprint(free.shape, (robot_xy_m - lower_xy) / size, robot.radius_m / size)
    if gaussians is not None:
        low_gaussians = low_surface_counts(
            gaussians,
            robot,
            below_m=lower[2] + low_k * size if len(column) else config.clearance_below_m,
            lower_m=lower_xy,
            size_m=size,
            shape=(nx - low_i, ny - low_j),
        )
        occupied |= are_surfaces(low_gaussians, size)
    if touched_m is not None:
        occupied |= _cells_with(touched_m, lower_xy, size, occupied.shape)
    if forbidden is not None:
        occupied |= forbidden[low_i:nx, low_j:ny]
    blocked = np.ascontiguousarray(occupied | ~free)
    clearance = _clearance_m(blocked, cap, size)
    if gaussians is not None:
        tips = tips_in_the_way(
            gaussians,
            robot,
            above_m=config.clearance_below_m,
            lower_m=lower_xy,
            size_m=size,
            occupied=occupied,
            places=clearance >= robot.radius_m - 1e-6,
        )
        if tips.any():
            blocked |= tips
            clearance = _clearance_m(blocked, cap, size)
    height = high_k - low_k
    unobserved = counts[..., VoxelState.UNOBSERVED] / np.float32(height) if height else 1.0 - free
    window = 2 * round(robot.radius_m / size) + 1
    unobserved = uniform_filter(unobserved.astype(np.float32), size=window, mode="nearest")
    span = max(config.preferred_clearance_m - robot.radius_m, 1e-6)
    tightness = np.clip((config.preferred_clearance_m - clearance) / span, 0.0, 1.0)
    tight = clearance < robot.radius_m + config.margin_m - 1e-6
    soft = 1.0 + config.clearance_weight * (tightness + tight) + config.unobserved_weight * unobserved
    soft_cost = np.ascontiguousarray(soft, dtype=np.float32)
    passable = clearance >= robot.radius_m - 1e-6
    return NavigationGrid(
        lower_m=lower_xy,
        size_m=size,
        blocked=blocked,
        clearance_m=clearance,
        soft_cost=soft_cost,
        cost=np.where(passable, soft_cost, np.float32(np.inf)).astype(np.float32),
        radius_m=robot.radius_m,
        margin_m=config.margin_m,
        clearance_cap_m=cap,
    )


def clearance_reach_m(cap_m: float, robot: RobotConfig, size_m: float) -> float:
    """How far away something may be and still bear on a cell's clearance: what is blocked, up to the cap,
    and on whether a tip is in somebody's way, up to a radius on both sides of it."""
    return cap_m + 2.0 * (robot.radius_m + size_m)


def _clearance_m(blocked: Bool[ndarray, "nx ny"], cap_m: float, size_m: float) -> Float32[ndarray, "nx ny"]:
    """From each cell's middle to the nearest blocked box, up to the cap."""
    cells = kernels.grid_box_clearance(blocked.view(np.uint8), cap_m / size_m)
    return (cells * np.float32(size_m)).astype(np.float32)


def _cells_with(
    points_m: Float[ndarray, "n 2"],
    lower_m: Float[ndarray, " 2"],
    size_m: float,
    shape: tuple[int, ...],
) -> Bool[ndarray, "nx ny"]:
    """Cells that hold any of the points."""
    ij = np.floor((points_m - lower_m) / size_m).astype(np.int64)
    inside = np.all((ij >= 0) & (ij < np.array(shape)), axis=1)
    cells = np.zeros(shape, bool)
    cells[tuple(ij[inside].T)] = True
    return cells


def _footprint(shape: tuple[int, ...], centre: Float[ndarray, " 2"], radius: float) -> Bool[ndarray, "nx ny"]:
    """Cells whose box meets the disc (all in cells)."""
    inside = np.zeros(shape, bool)
    first = np.clip(np.floor(centre - radius).astype(int), 0, shape)
    last = np.clip(np.floor(centre + radius).astype(int) + 1, 0, shape)
    dx = np.maximum(np.abs(np.arange(first[0], last[0]) + 0.5 - centre[0]) - 0.5, 0.0)
    dy = np.maximum(np.abs(np.arange(first[1], last[1]) + 0.5 - centre[1]) - 0.5, 0.0)
    inside[first[0] : last[0], first[1] : last[1]] = np.hypot(dx[:, None], dy[None, :]) < radius - 1e-9
    return inside
