"""`hgs bench planners` and `hgs bench tables`: options, exit codes, and what is said on the way."""

import os
import signal
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import bench_planners
from app.cli.application import application
from hgs_core.benchmark.planners import grid as grid_module
from hgs_core.benchmark.planners import run as run_module
from hgs_core.benchmark.planners.grid import GridRequest
from hgs_core.errors import ConfigError
from tests.benchmark.planners.fake_cells import FAILING, FakeEngine, asked


def hgs(*arguments: object):
    return CliRunner().invoke(application, ["bench", *map(str, arguments)], env={"COLUMNS": "200"})


@pytest.fixture
def requests(monkeypatch: pytest.MonkeyPatch) -> list[GridRequest]:
    """Missions that take no time in scenes that are not opened; the requests made are collected."""
    made: list[GridRequest] = []

    def planned(request: GridRequest, **_: object):
        made.append(request)
        return asked(request.out, request.planners, request.seeds, request.scenes)[1]

    monkeypatch.setattr(grid_module, "plan_cells", planned)
    monkeypatch.setattr(bench_planners, "_engine", lambda *chosen: FakeEngine())
    return made


def test_lists_by_commas_or_by_repetition(requests: list[GridRequest], tmp_path: Path) -> None:
    several = ("--scenes", "house,house:1", "--planners", "paper", "--planners", "best", "--seeds", "0,2")
    result = hgs("planners", *several, "--set", "threads=1", "--out", tmp_path / "grid")
    assert result.exit_code == 0, result.output
    (request,) = requests
    assert (request.scenes, request.planners) == (["house", "house:1"], ["paper", "best"])
    assert (request.seeds, request.preset, request.overrides) == ([0, 2], "bench", {"threads": "1"})
    assert "[8/8] house:1, best, seed 2: complete, 11.0 m, observable ratio 0.960" in result.stderr
    assert "left" in result.stderr.split("[8/8]")[0]
    assert "8 of 8 missions finished" in result.stdout
    again = hgs("planners", *several, "--set", "threads=1", "--out", tmp_path / "grid")
    assert again.exit_code == 0
    assert "[" not in again.stderr


def test_the_papers_planners_and_best_with_two_seeds_unless_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[GridRequest] = []

    def refused(request: GridRequest, **_: object) -> None:
        made.append(request)
        raise ConfigError("far enough")

    monkeypatch.setattr(grid_module, "plan_cells", refused)
    assert hgs("planners", "--scenes", "house", "--out", tmp_path).exit_code == 2
    seven = ["tare", "coverage", "quality", "both", "paper", "gs-planner", "naruto"]
    assert (made[0].planners, made[0].seeds) == ([*seven, "best"], [0, 1])


def test_failures_are_told_and_give_exit_code_4(requests: list[GridRequest], tmp_path: Path) -> None:
    result = hgs(
        *(
            "planners",
            "--scenes",
            "house",
            "--planners",
            "paper",
            "--seeds",
            f"0,{FAILING}",
            "--out",
            tmp_path,
        )
    )
    assert result.exit_code == 4
    assert f"house, paper, seed {FAILING}: failed: SceneError: no floor" in result.stderr
    assert "1 of 2 missions finished" in result.stdout


def test_ctrl_c_keeps_what_is_finished_and_says_how_to_go_on(
    requests: list[GridRequest], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted(FakeEngine):
        def ended(self, timeout_s: float):
            os.kill(os.getpid(), signal.SIGINT)
            return super().ended(timeout_s)

    monkeypatch.setattr(bench_planners, "_engine", lambda *chosen: Interrupted())
    options = ("planners", "--scenes", "house", "--planners", "paper", "--out", tmp_path)
    result = hgs(*options)
    assert result.exit_code == 130
    assert "the same command goes on" in result.stderr
    assert "1 of 2 missions finished" in result.stdout
    monkeypatch.setattr(bench_planners, "_engine", lambda *chosen: FakeEngine())
    assert hgs(*options).exit_code == 0


def test_tables_again(requests: list[GridRequest], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hgs("planners", "--scenes", "house", "--planners", "paper", "--seeds", "0", "--out", tmp_path)

    def never(*_: object, **__: object) -> None:
        raise AssertionError("a mission was run")

    monkeypatch.setattr(run_module, "run_grid", never)
    for command in (("tables", tmp_path), ("planners", "--tables-only", "--out", tmp_path)):
        (tmp_path / "tables.md").unlink()
        assert hgs(*command).exit_code == 0
        assert (tmp_path / "tables.md").is_file()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("tables", "nowhere"), "not a folder that `hgs bench planners` left behind"),
        (("planners", "--out", "x"), "--scenes"),
        (("planners", "--scenes", "house", "--seeds", "one", "--out", "x"), "'one' is not a seed"),
        (
            ("planners", "--scenes", "house", "--planners", "papier", "--out", "x"),
            "no planner preset 'papier'",
        ),
    ],
)
def test_wrong_use_is_told(
    arguments: tuple[str, ...], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = hgs(*arguments)
    assert result.exit_code == 2
    assert told in result.output
    assert list(tmp_path.iterdir()) == []


def test_a_span_of_seeds_is_every_one_of_them(requests: list[GridRequest], tmp_path: Path) -> None:
    options = ("--planners", "best", "--seeds", "0", "--out", tmp_path / "grid")
    assert hgs("planners", "--scenes", "house,warren:3-5", *options).exit_code == 0
    assert requests[0].scenes == ["house", "warren:3", "warren:4", "warren:5"]
    assert (tmp_path / "grid" / "shortfalls.md").is_file()
    assert hgs("planners", "--scenes", "warren:5-3", *options).exit_code == 2
