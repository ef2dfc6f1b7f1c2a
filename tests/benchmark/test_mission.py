"""`hgs bench mission`: a mission's times, by part of it."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.benchmark.mission import MissionBenchmark, Spread


def test_spreads() -> None:
    assert Spread.of([]) == Spread(median=None, p95=None)
    spread = Spread.of([0.1, 0.2, 0.3])
    assert spread.median == pytest.approx(200.0)
    assert spread.p95 == pytest.approx(290.0)


def test_a_short_mission_is_timed_and_leaves_only_its_figures(tmp_path: Path) -> None:
    path = tmp_path / "figures.json"
    result = CliRunner().invoke(
        application,
        [
            *("bench", "mission", "--scene", "house", "--preset", "quick", "--max-time", "9"),
            *("--set", "threads=1", "--set", "mapping.iterations_per_s=2.5", "--json", str(path)),
        ],
        env={"COLUMNS": "160"},
    )
    assert result.exit_code == 0, result.output
    assert "T_GP" in result.stdout
    figures = MissionBenchmark.model_validate_json(path.read_text())
    assert figures.stop_reason == "time_limit"
    assert figures.cycles >= 1
    assert len(figures.parts) == 4
    assert figures.parts[-1].n_gaussians >= figures.n_gaussians  # the mission ends with a pruning
    total = figures.planning_ms.median
    assert total is not None
    assert total > 0
    assert [path.name for path in tmp_path.iterdir()] == ["figures.json"]
