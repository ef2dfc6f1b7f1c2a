"""Full-knowledge paths of a grid's scenes: worked out once, kept in the grid's folder, read by its tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from hgs_core.benchmark.planners.cell import read_json, scene_file_name, write_text
from hgs_core.benchmark.planners.grid import GridFile, PlannedScene
from hgs_core.benchmark.planners.tables import ReferencePaths
from hgs_core.errors import ConfigError
from hgs_core.evaluation.full_knowledge import FullKnowledgePath, full_knowledge_path
from hgs_core.mission.ceiling import ceiling_request
from hgs_core.mission.config import MissionConfig
from hgs_core.scene.scene import open_scene

REFERENCES: Final = "references"


def write_references(
    root: Path, scenes: Sequence[PlannedScene], config: MissionConfig, *, progress: Callable[[str], None]
) -> None:
    """`references/SCENE.json` for each scene that has none. A minute or two of one core each."""
    for scene in scenes:
        path = _path(root, scene.name)
        if path.is_file():
            continue
        progress(f"path of full knowledge through {scene.name}")
        world = open_scene(scene.source, radius_m=config.robot.radius_m, height_m=config.robot.height_m)
        request = ceiling_request(config, (world.start.x_m, world.start.y_m))
        found = full_knowledge_path(world.caster, request, progress=progress)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, found.model_dump_json(indent=2) + "\n")


def read_references(root: Path, grid: GridFile) -> ReferencePaths:
    """Lengths of the paths that are there. Raises `ConfigError` for a file that is none."""
    lengths: dict[str, dict[float, float]] = {}
    for scene in grid.scenes:
        path = _path(root, scene)
        if not path.is_file():
            continue
        try:
            found = FullKnowledgePath.model_validate(read_json(path))
        except ValidationError as error:
            raise ConfigError(f"{path} is not a path of full knowledge: {error}; remove it") from error
        lengths[scene] = {route.level: route.length_m for route in found.routes}
    return lengths


def _path(root: Path, scene: str) -> Path:
    return root / REFERENCES / f"{scene_file_name(scene)}.json"
