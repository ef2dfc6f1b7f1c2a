"""`hgs bench gains`: the planner's gains against the exact scores."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.benchmark.gains import GainBenchmark, draw_poses, fidelity


def test_the_same_order_is_full_fidelity_and_the_reverse_is_none() -> None:
    exact = np.arange(40.0) ** 2
    same, reverse = fidelity(exact, np.sqrt(exact)), fidelity(exact, -exact)
    assert same.spearman == pytest.approx(1.0)
    assert same.best_among_first == 1.0
    assert same.n_gaining == 38  # 0 and 1 are less than a thousandth of 39 squared
    assert same.spearman_gaining == pytest.approx(1.0)
    assert reverse.spearman == pytest.approx(-1.0)
    assert reverse.best_among_first == 0.0


def test_places_come_round_again_only_when_all_were_taken() -> None:
    places = np.arange(14.0).reshape(7, 2)
    poses = draw_poses(places, 10, np.random.default_rng(0))
    assert len(np.unique(poses[:7, :2], axis=0)) == 7
    assert len(np.unique(poses[:, 2])) == 10


def bench_gains(until_s: str, *more: str) -> tuple[int, str]:
    arguments = [
        "bench",
        "gains",
        "--scene",
        "house",
        "--preset",
        "quick",
        "--until",
        until_s,
        "--views",
        "20",
    ]
    settings = ["--set", "threads=1", "--set", "mapping.iterations_per_s=5"]
    result = CliRunner().invoke(application, [*arguments, *settings, *more], env={"COLUMNS": "160"})
    return result.exit_code, result.output


def test_gains_rank_views_of_a_mission_as_the_exact_scores_do(tmp_path: Path) -> None:
    path = tmp_path / "figures.json"
    code, output = bench_gains("14", "--json", str(path))
    assert code == 0, output
    assert "rank correlation" in output
    figures = GainBenchmark.model_validate_json(path.read_text())
    assert figures.n_views == len(figures.quality.exact) == len(figures.coverage.fast) == 20
    assert figures.quality.spearman > 0.7
    assert figures.coverage.spearman > 0.8


def test_a_mission_too_short_to_weigh_anything_says_so() -> None:
    code, output = bench_gains("1")
    assert code == 2
    assert "run for longer" in output
