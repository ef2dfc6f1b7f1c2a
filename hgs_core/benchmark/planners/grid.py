"""Which missions a grid consists of, and under which conditions each has to run."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from hgs_core.benchmark.planners.cell import CellKey, read_json, write_text
from hgs_core.benchmark.planners.fingerprint import Fingerprint, scene_digest
from hgs_core.config.base import StrictConfig
from hgs_core.errors import ConfigError
from hgs_core.mission.config import MissionConfig, resolve_mission_config
from hgs_core.scene.built_in import built_in_scene
from hgs_core.scene.scene import open_scene

GRID: Final = "grid.json"
_FEW_SCENES: Final = 8


@dataclass(frozen=True, kw_only=True)
class GridRequest:
    """Every planner on every scene with every seed, under one mission preset."""

    scenes: Sequence[str]
    """`house`, `house:SEED`, or mesh files."""
    planners: Sequence[str]
    """Planner presets."""
    seeds: Sequence[int]
    preset: str
    overrides: dict[str, str]
    """`section.key` -> YAML text, for all missions."""
    out: Path


@dataclass(frozen=True, kw_only=True)
class PlannedScene:
    """A scene as missions will see it."""

    source: str
    """Built-in name or absolute path."""
    name: str
    digest: str
    lower_m: tuple[float, float]
    upper_m: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class PlannedCell:
    """One mission of the grid, its settings resolved."""

    key: CellKey
    scene: PlannedScene
    threads: int
    fingerprint: Fingerprint


class GridFile(StrictConfig):
    """`grid.json`: what was asked of this folder so far, so that tables can mark what is missing."""

    preset: str
    overrides: dict[str, str]
    cells: tuple[CellKey, ...]

    @property
    def scenes(self) -> list[str]:
        """In the order in which they were asked for; likewise below."""
        return list(dict.fromkeys(cell.scene for cell in self.cells))

    @property
    def planners(self) -> list[str]:
        return list(dict.fromkeys(cell.planner for cell in self.cells))

    def of(self, planner: str, scene: str) -> list[CellKey]:
        """The cells of one planner on one scene, by seed."""
        cells = [cell for cell in self.cells if (cell.planner, cell.scene) == (planner, scene)]
        return sorted(cells, key=lambda cell: cell.seed)

    @staticmethod
    def read(root: Path) -> GridFile:
        """Raises `ConfigError` where `root` holds no grid."""
        path = root / GRID
        if not path.is_file():
            raise ConfigError(f"{path} is missing: not a folder that `hgs bench planners` left behind")
        try:
            return GridFile.model_validate(read_json(path))
        except ValidationError as error:
            raise ConfigError(f"{path} is not a grid of missions: {error}") from error

    def write(self, root: Path) -> None:
        root.mkdir(parents=True, exist_ok=True)
        write_text(root / GRID, self.model_dump_json(indent=2) + "\n")


def plan_cells(
    request: GridRequest, *, progress: Callable[[str], object] = lambda message: None
) -> list[PlannedCell]:
    """The grid's cells: scene by scene, so that a scene's comparison is complete as early as can be.

    Opens every scene, some seconds each, and tells `progress` how far it is. Raises `ConfigError` or
    `SceneError` for whatever could not run.
    """
    for name, given in (("scenes", request.scenes), ("planners", request.planners), ("seeds", request.seeds)):
        if not given or len(set(given)) < len(given):
            raise ConfigError(f"{name}: {list(given)} must name at least one, and none twice")
    if "planner" in request.overrides:
        raise ConfigError("--set planner=... is for one mission: name the grid's planners with --planners")
    configs = {
        planner: resolve_mission_config(request.preset, {**request.overrides, "planner": planner})
        for planner in request.planners
    }
    some_config = next(iter(configs.values()))
    scenes = []
    for scene in _opened(request.scenes, some_config):
        scenes.append(scene)
        progress(f"opened {len(scenes)} of {len(request.scenes)} scenes")
    for one, other in itertools.combinations(scenes, 2):
        if one.name == other.name:
            raise ConfigError(
                f"the scenes {one.source} and {other.source} are both called {one.name}: rename one"
            )
    return [
        PlannedCell(
            key=CellKey(planner=planner, scene=scene.name, seed=seed),
            scene=scene,
            threads=config.threads,
            fingerprint=Fingerprint.of(scene.digest, config),
        )
        for scene in scenes
        for seed in request.seeds
        for planner, config in configs.items()
    ]


def remembered(request: GridRequest, cells: Sequence[PlannedCell], *, redo: bool) -> GridFile:
    """`grid.json` brought up to date, not yet written: what was asked of the folder before, and `cells`.

    Raises `ConfigError` for a folder that holds a grid with another preset or other settings, unless `redo`
    and all its cells are asked for again.
    """
    asked = tuple(cell.key for cell in cells)
    grid = GridFile(preset=request.preset, overrides=request.overrides, cells=asked)
    if not (request.out / GRID).exists():
        return grid
    before = GridFile.read(request.out)
    if (before.preset, before.overrides) == (grid.preset, grid.overrides):
        return grid.model_copy(update={"cells": tuple(dict.fromkeys((*before.cells, *asked)))})
    if redo and set(before.cells) <= set(asked):
        return grid
    raise ConfigError(
        f"{request.out} holds a grid of preset {before.preset!r} with settings {before.overrides}, not of "
        f"{grid.preset!r} with {grid.overrides}, and one table compares missions on equal terms: choose "
        "another --out, or name all its scenes, planners and seeds with --redo"
    )


def _opened(sources: Sequence[str], config: MissionConfig) -> Iterator[PlannedScene]:
    """The scenes in their order: many are opened by several processes, few before these would have begun."""
    if len(sources) <= _FEW_SCENES:
        yield from (_planned(source, config) for source in sources)
        return
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        yield from pool.map(partial(_planned, config=config), sources)


def _planned(source: str, config: MissionConfig) -> PlannedScene:
    absolute = source if built_in_scene(source) is not None else str(Path(source).resolve())
    scene = open_scene(absolute, radius_m=config.robot.radius_m, height_m=config.robot.height_m)
    lower, upper = scene.bounds.lower_m, scene.bounds.upper_m
    return PlannedScene(
        source=absolute,
        name=scene.name,
        digest=scene_digest(scene),
        lower_m=(float(lower[0]), float(lower[1])),
        upper_m=(float(upper[0]), float(upper[1])),
    )
