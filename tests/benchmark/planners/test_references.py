"""Paths of full knowledge in a grid's folder: worked out once, read by the tables."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgs_core.benchmark.planners.cell import CellKey
from hgs_core.benchmark.planners.grid import GridFile, PlannedScene
from hgs_core.benchmark.planners.references import read_references, write_references
from hgs_core.errors import ConfigError
from hgs_core.evaluation.full_knowledge import CoveringRoute, FullKnowledgePath
from hgs_core.mission.config import MissionConfig

GRID = GridFile(preset="bench", overrides={}, cells=(CellKey(planner="best", scene="a b", seed=0),))


def test_what_is_kept_is_read_and_not_worked_out_again(tmp_path: Path) -> None:
    route = CoveringRoute(level=0.9, seen_share=0.91, length_m=12.5, route_m=((0.0, 0.0),), looks=())
    found = FullKnowledgePath(n_observable=10, n_samples=5, n_places=3, visible_share=1.0, routes=(route,))
    assert read_references(tmp_path, GRID) == {}
    path = tmp_path / "references" / "a-b.json"
    path.parent.mkdir()
    path.write_text(found.model_dump_json())
    assert read_references(tmp_path, GRID) == {"a b": {0.9: 12.5}}
    scene = PlannedScene(source="no such file", name="a b", digest="", lower_m=(0.0, 0.0), upper_m=(1.0, 1.0))
    config = MissionConfig(description="t")
    write_references(tmp_path, [scene], config, progress=lambda message: None)  # opens nothing


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "references" / "a-b.json"
    path.parent.mkdir()
    path.write_text('{"routes": 3}')
    with pytest.raises(ConfigError, match=r"a-b\.json is not a path of full knowledge"):
        read_references(tmp_path, GRID)
