"""`hgs bench paths`: a car's ways between random poses of fully known scenes, beside a disc's by A*.

The floor is the true one, drawn into a voxel map of the planner's own resolution; what finds and smooths the
ways, and what they are compared with, is what missions drive by.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import BaseModel, ConfigDict

from hgs_core.errors import ConfigError, SceneError
from hgs_core.geometry.boxes import Box
from hgs_core.native import kernels
from hgs_core.planning.car_ways import CarWays, KinodynamicConfig, body_of, poses_free
from hgs_core.planning.navigation_grid import NavigationConfig, NavigationGrid, build_navigation_grid
from hgs_core.planning.path_search import reach_from, shortest_path
from hgs_core.robot.ackermann import AckermannConfig, driven_arcs
from hgs_core.robot.motion import GroundPose
from hgs_core.robot.path import Path
from hgs_core.scene.free_floor import StartPose, floor_under
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import Scene, open_scene
from hgs_core.simulation.body import Body
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState

_LEAST_APART_M: Final = 0.5
"""A goal is no nearer to its start: a length of nothing has no ratio."""
_TRIES: Final = 200
"""So many random poses are drawn for one that the car fits in, before a scene counts as too tight."""


class Spread(BaseModel):
    """Of one figure over all queries that have it."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    median: float
    p95: float
    max: float

    @staticmethod
    def of(values: Sequence[float]) -> Spread | None:
        """None of no values."""
        if not values:
            return None
        return Spread(median=np.median(values), p95=np.quantile(values, 0.95), max=max(values))


class PathBenchmark(BaseModel):
    """Ways of a car between random poses."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    scenes: list[str]
    seed: int
    pairs: int
    """Start and goal: poses that the car fits in, at places that a disc can drive between."""
    found: int
    """Pairs with a way."""
    within_reach: int
    """Pairs whose goal the car can come to by the search of all poses that planners ask first."""
    found_within_reach: int
    missed: list[str]
    """Where a pose counted as within reach and no way was found: scene, start and goal [m, m, rad]."""
    touching: int
    """Ways on which the body would touch a true obstacle."""
    tightest_turn_share: float | None
    """Greatest curvature on any way, as a share of the car's own limit."""
    length_to_astar: Spread | None
    """Length of a way over that of the disc's smoothed A* path between the same places."""
    length_m: Spread | None
    gear_changes: Spread | None
    query_ms: Spread | None
    """Wall time of one query, of those with a way."""
    failed_query_ms: Spread | None
    """Of those without."""
    reach_ms: Spread | None
    """Wall time of the search of all poses, once a start."""
    threads: int
    variant: str


@dataclass(frozen=True, kw_only=True, eq=False)
class _KnownFloor:
    name: str
    grid: NavigationGrid
    obstacles: BodyObstacles
    start_xy: Float[ndarray, " 2"]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Query:
    """What came of one pair."""

    reach_ms: float
    within_reach: bool
    query_ms: float
    path: Path | None
    astar_m: float


def run_path_benchmark(
    scenes: Sequence[str],
    *,
    pairs: int,
    seed: int,
    car: AckermannConfig,
    navigation: NavigationConfig,
    search: KinodynamicConfig,
    progress: Callable[[str], None] = lambda message: None,
) -> PathBenchmark:
    """As many pairs in each scene, the first ones one more where they do not divide.

    Raises `ConfigError` for fewer pairs than scenes, and `SceneError` for a scene in which the car fits
    nowhere.
    """
    if pairs < len(scenes):
        raise ConfigError(f"{pairs} pairs are fewer than the {len(scenes)} scenes: ask for one in each")
    found: list[tuple[_KnownFloor, Float[ndarray, " 3"], Float[ndarray, " 3"], _Query]] = []
    for k, name in enumerate(scenes):
        progress(f"opening {name}")
        world = open_scene(name, radius_m=car.radius_m, height_m=car.height_m)
        floor = _known_floor(world, car, navigation)
        share = pairs // len(scenes) + (k < pairs % len(scenes))
        for start, goal in _random_pairs(floor, car, search, share, np.random.default_rng((seed, k))):
            found.append((floor, start, goal, _asked(floor, car, search, start, goal)))
            progress(f"{world.name}: {len(found)} of {pairs}")
    driven = [(floor, one.path, one.astar_m) for floor, _, _, one in found if one.path is not None]
    arcs = [_arcs(path) for _, path, _ in driven]
    lengths = [float(length.sum()) for _, length, _ in arcs]
    curvatures = [float(np.abs(curvature).max(initial=0.0)) for _, _, curvature in arcs]
    return PathBenchmark(
        scenes=list(scenes),
        seed=seed,
        pairs=len(found),
        found=len(driven),
        within_reach=sum(one.within_reach for *_, one in found),
        found_within_reach=sum(one.within_reach and one.path is not None for *_, one in found),
        missed=[
            f"{floor.name}: {_told(start)} to {_told(goal)}"
            for floor, start, goal, one in found
            if one.within_reach and one.path is None
        ],
        touching=sum(_touches(floor.obstacles, car, path) for floor, path, _ in driven),
        tightest_turn_share=max(curvatures) * car.min_turning_radius_m if curvatures else None,
        length_to_astar=Spread.of(
            [length / astar_m for length, (_, _, astar_m) in zip(lengths, driven, strict=True)]
        ),
        length_m=Spread.of(lengths),
        gear_changes=Spread.of([float(np.count_nonzero(np.diff(gears))) for gears, _, _ in arcs]),
        query_ms=Spread.of([one.query_ms for *_, one in found if one.path is not None]),
        failed_query_ms=Spread.of([one.query_ms for *_, one in found if one.path is None]),
        reach_ms=Spread.of([one.reach_ms for *_, one in found]),
        threads=kernels.threads(),
        variant=kernels.variant(),
    )


def _known_floor(world: Scene, car: AckermannConfig, navigation: NavigationConfig) -> _KnownFloor:
    """Every column as a camera would leave it that had seen all of it: a voxel that holds any part of an
    obstacle is occupied, one above floor is free, and so nothing else is."""
    obstacles = BodyObstacles(world.caster.mesh, car.height_m)
    voxels = VoxelMap(VoxelConfig(), region=_body_box(world.caster, car))
    size = voxels.config.size_m
    ij = np.stack(np.meshgrid(*map(np.arange, voxels.states.shape[:2]), indexing="ij"), axis=-1)
    centres = voxels.lower_m()[:2] + (ij + 0.5) * size
    # Nearer than half a diagonal: the cell holds a part of it, or one of its corners nearly does.
    taken = obstacles.clearance_m(centres) < size / np.sqrt(2.0)
    free = floor_under(world.caster, centres, car.height_m) & ~taken
    voxels.states[taken] = VoxelState.OCCUPIED
    voxels.states[free] = VoxelState.FREE
    voxels.note_change()
    return _KnownFloor(
        name=world.name,
        grid=build_navigation_grid(voxels, navigation, car, robot_xy_m=None),
        obstacles=obstacles,
        start_xy=np.array([world.start.x_m, world.start.y_m]),
    )


def _body_box(caster: RayCaster, car: AckermannConfig) -> Box:
    bounds = caster.mesh.bounds()
    return Box(
        lower_m=np.array([*bounds.lower_m[:2], 0.0]), upper_m=np.array([*bounds.upper_m[:2], car.height_m])
    )


def _random_pairs(
    floor: _KnownFloor, car: AckermannConfig, search: KinodynamicConfig, count: int, rng: np.random.Generator
) -> Iterator[tuple[Float[ndarray, " 3"], Float[ndarray, " 3"]]]:
    """Poses anywhere that a disc can drive to from the scene's start and the car fits in."""
    cells = np.flatnonzero(reach_from(floor.grid, floor.start_xy).reachable)
    if not len(cells):
        raise SceneError(f"{floor.name}: a robot of radius {car.radius_m} m cannot leave its start")
    for _ in range(count):
        start = _random_pose(floor, car, search, cells, rng)
        goals = (_random_pose(floor, car, search, cells, rng) for _ in range(_TRIES))
        goal = next((goal for goal in goals if np.hypot(*(goal - start)[:2]) >= _LEAST_APART_M), None)
        if goal is None:
            raise SceneError(f"{floor.name}: nowhere to drive to, {_LEAST_APART_M} m or more from a start")
        yield start, goal


def _random_pose(
    floor: _KnownFloor,
    car: AckermannConfig,
    search: KinodynamicConfig,
    cells: Int[ndarray, " n"],
    rng: np.random.Generator,
) -> Float[ndarray, " 3"]:
    places = floor.grid.centres_m(rng.choice(cells, _TRIES))
    poses = np.column_stack([places, rng.uniform(-np.pi, np.pi, _TRIES)])
    fits = poses_free(floor.grid, body_of(car, search.margin_m), poses, standing=np.zeros((0, 3)))
    if not fits.any():
        raise SceneError(f"{floor.name}: the car fits in none of {_TRIES} random poses")
    pose: Float[ndarray, " 3"] = poses[np.argmax(fits)]
    return pose


def _asked(
    floor: _KnownFloor,
    car: AckermannConfig,
    search: KinodynamicConfig,
    start: Float[ndarray, " 3"],
    goal: Float[ndarray, " 3"],
) -> _Query:
    grid = floor.grid
    began = time.perf_counter()
    ways = CarWays(grid, car, search, start)
    reached = time.perf_counter()
    path = ways.way(start, goal[:2], goal[2:])
    ended = time.perf_counter()
    from_cell, to_cell = (int(cell) for cell in grid.cells_of(np.stack([start[:2], goal[:2]]))[0])
    by_astar = shortest_path(grid, from_cell, to_cell)
    if by_astar is None:
        raise SceneError(f"{floor.name}: both cells are reachable, and A* finds no way between them")
    return _Query(
        reach_ms=1000 * (reached - began),
        within_reach=bool(ways.may_stand(np.array([to_cell]), goal[None, :2], goal[2:]).all()),
        query_ms=1000 * (ended - reached),
        path=path,
        astar_m=float(np.linalg.norm(np.diff(by_astar, axis=0), axis=1).sum()),
    )


def _arcs(path: Path) -> tuple[Float[ndarray, " m"], Float[ndarray, " m"], Float[ndarray, " m"]]:
    assert path.headings_rad is not None
    return driven_arcs(path.positions_m, path.headings_rad)


def _touches(obstacles: BodyObstacles, car: AckermannConfig, path: Path) -> bool:
    """Driven by the body that simulated missions drive; its first pose is the start, where the car fits."""
    assert path.headings_rad is not None
    (x, y), yaw = path.positions_m[0].tolist(), float(path.headings_rad[0])
    body = Body(car, obstacles, StartPose(x_m=x, y_m=y, yaw_rad=yaw))
    return not all(
        body.move_to(GroundPose(x_m=x, y_m=y, yaw_rad=yaw))
        for (x, y), yaw in zip(path.positions_m.tolist(), path.headings_rad.tolist(), strict=True)
    )


def _told(pose: Float[ndarray, " 3"]) -> str:
    return "({:.2f}, {:.2f}, {:.2f})".format(*pose)
