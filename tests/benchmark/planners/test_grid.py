"""A grid goes on where it was left, and keeps nothing that would not come out the same."""

import csv
import fcntl
import json
import shutil
from pathlib import Path

import pytest

from hgs_core.benchmark.planners.cell import CellFiles, CellKey, CellStatus
from hgs_core.benchmark.planners.fingerprint import differences, scene_digest
from hgs_core.benchmark.planners.grid import GridFile, GridRequest, plan_cells
from hgs_core.benchmark.planners.outputs import write_outputs
from hgs_core.benchmark.planners.results import GridResults
from hgs_core.errors import ConfigError, SceneError
from hgs_core.scene.scene import open_scene
from tests.benchmark.planners.fake_cells import FAILING, FakeEngine, Watcher, asked, run_fake_grid
from tests.scene.worlds import room, textured, with_boxes, y_up


def rows(root: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((root / "results.csv").read_text().splitlines()))


def test_every_cell_leaves_its_folder_its_record_and_a_row(tmp_path: Path) -> None:
    request, cells = asked(tmp_path / "grid")
    seen = run_fake_grid(request, cells, write_outputs=lambda: write_outputs(request.out))
    assert [str(result.key) for result in seen.ended] == [str(cell.key) for cell in cells]
    assert seen.left_s[-1] == 0.0
    for cell in cells:
        assert (CellFiles(request.out, cell.key).folder / "report.json").is_file()
    written = rows(request.out)
    assert [(row["planner"], row["scene"], row["seed"]) for row in written] == [
        ("paper", "house", "0"),
        ("nearest-frontier", "house", "0"),
        ("paper", "house", "1"),
        ("nearest-frontier", "house", "1"),
    ]
    assert [float(row["path_length_m"]) for row in written] == [10.0, 14.0, 11.0, 15.0]
    assert {row["planning_s.median"] for row in written} == {"0.1"}
    assert {row["status"] for row in written} == {"finished"}
    assert "completion_curve" not in written[0]


def test_what_is_finished_is_kept_and_the_rest_is_run(tmp_path: Path) -> None:
    request, cells = asked(tmp_path)
    first = FakeEngine()
    run_fake_grid(request, cells, first, watcher=Watcher(stop_after=2))
    assert first.closed
    statuses = [CellFiles(tmp_path, cell.key).read().status for cell in cells]
    assert statuses == [CellStatus.FINISHED] * 2 + [CellStatus.UNFINISHED] * 2
    killed = CellFiles(tmp_path, cells[2].key)
    killed.partial.mkdir()
    (killed.partial / "events.jsonl").write_text("half a line")
    second = FakeEngine()
    run_fake_grid(request, cells, second)
    assert second.started == [str(cell.key) for cell in cells[2:]]
    assert not killed.partial.exists()
    third = FakeEngine()
    run_fake_grid(request, cells, third)
    assert third.started == []


def test_missing_cells_are_marked_before_they_are_run(tmp_path: Path) -> None:
    request, cells = asked(tmp_path)
    run_fake_grid(
        request, cells, watcher=Watcher(stop_after=1), write_outputs=lambda: write_outputs(tmp_path)
    )
    assert [row["status"] for row in rows(tmp_path)] == ["finished"] + ["unfinished"] * 3
    assert rows(tmp_path)[1]["path_length_m"] == ""
    tables = (tmp_path / "tables.md").read_text()
    assert "1 of 4 missions finished, 3 unfinished" in tables
    assert "10.0 [1 of 2: unfinished]" in tables


def test_a_cell_that_fails_says_why_and_holds_up_nobody(tmp_path: Path) -> None:
    request, cells = asked(tmp_path, planners=["paper"], seeds=[FAILING, 0])
    seen = run_fake_grid(request, cells, write_outputs=lambda: write_outputs(tmp_path))
    assert [result.status for result in seen.ended] == [CellStatus.FAILED, CellStatus.FINISHED]
    failed, finished = rows(tmp_path)
    assert failed["status"] == "failed"
    assert failed["failure"].startswith("SceneError: no floor & nowhere to stand")
    assert finished["failure"] == ""
    again = FakeEngine()
    run_fake_grid(request, cells, again)
    assert again.started == [str(cells[0].key)]


def test_other_settings_are_refused_by_name_or_run_again(tmp_path: Path) -> None:
    request, cells = asked(tmp_path)
    run_fake_grid(request, cells)
    changed = [
        cell
        if cell.key.planner == "paper"
        else cell.__class__(
            **{
                **vars(cell),
                "fingerprint": cell.fingerprint.model_copy(
                    update={"settings": {"threads": 1, "planner": {"gain_threshold": 0.7}}}
                ),
            }
        )
        for cell in cells
    ]
    engine = FakeEngine()
    with pytest.raises(ConfigError, match=r"planner\.gain_threshold was 0\.5 and is 0\.7.*1 more.*--redo"):
        run_fake_grid(request, changed, engine)
    assert engine.started == []
    run_fake_grid(request, changed, engine, redo=True)
    assert engine.started == [str(cell.key) for cell in changed if cell.key.planner != "paper"]
    run_fake_grid(request, changed, engine)


def test_a_finished_cell_without_a_record_is_not_trusted(tmp_path: Path) -> None:
    request, cells = asked(tmp_path)
    run_fake_grid(request, cells)
    CellFiles(tmp_path, cells[0].key).record.unlink()
    with pytest.raises(ConfigError, match="no record of its settings"):
        run_fake_grid(request, cells)


def test_one_folder_holds_one_preset_and_grows_in_planners(tmp_path: Path) -> None:
    request, cells = asked(tmp_path)
    run_fake_grid(request, cells)
    other, other_cells = asked(tmp_path, gain_threshold="0.9")
    with pytest.raises(ConfigError, match=r"holds a grid of preset 'robust' with settings {}, not of"):
        run_fake_grid(other, other_cells)
    more, more_cells = asked(tmp_path, planners=["best"], seeds=[3])
    run_fake_grid(more, more_cells)
    assert GridFile.read(tmp_path).cells == (*(cell.key for cell in cells), more_cells[0].key)
    assert GridResults.read(tmp_path).counted(CellStatus.FINISHED) == 5


def test_two_grids_do_not_share_a_folder(tmp_path: Path) -> None:
    request, cells = asked(tmp_path)
    with (tmp_path / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(ConfigError, match="another grid is running"):
            run_fake_grid(request, cells)


def test_a_mission_that_broke_off_is_a_failure_although_its_folder_is_whole(tmp_path: Path) -> None:
    request, cells = asked(tmp_path, planners=["paper"], seeds=[0])
    run_fake_grid(request, cells)
    path = CellFiles(tmp_path, cells[0].key).folder / "report.json"
    broken = {**json.loads(path.read_text()), "stop_reason": "failed", "stop_message": "RobotError: a wheel"}
    path.write_text(json.dumps(broken))
    result = CellFiles(tmp_path, cells[0].key).read()
    assert (result.status, result.message, result.report) == (CellStatus.FAILED, "RobotError: a wheel", None)


def test_damaged_files_are_named(tmp_path: Path) -> None:
    request, cells = asked(tmp_path, planners=["paper"], seeds=[0])
    run_fake_grid(request, cells)
    files = CellFiles(tmp_path, cells[0].key)
    files.record.write_text("{}")
    with pytest.raises(ConfigError, match=r"paper-0\.json is not the record of a cell"):
        files.read()
    shutil.rmtree(tmp_path / "cells")
    (tmp_path / "grid.json").write_text("[]")
    with pytest.raises(ConfigError, match="must hold a JSON object"):
        GridResults.read(tmp_path)
    with pytest.raises(ConfigError, match="not a folder that `hgs bench planners` left behind"):
        GridResults.read(tmp_path / "elsewhere")


def test_planned_cells_know_the_scene_and_the_resolved_settings(tmp_path: Path) -> None:
    for name, mesh in (("plain", room()), ("furnished", with_boxes(((0.5, 0.5, 0.0), (1.5, 1.2, 0.8))))):
        y_up(textured(mesh)).export(tmp_path / f"{name}.glb")
    request = GridRequest(
        scenes=[str(tmp_path / "plain.glb"), str(tmp_path / "furnished.glb")],
        planners=["paper", "nearest-frontier"],
        seeds=[0, 1],
        preset="robust",
        overrides={"limits.max_time_s": "15"},
        out=tmp_path,
    )
    told: list[str] = []
    cells = plan_cells(request, progress=told.append)
    assert told == ["opened 1 of 2 scenes", "opened 2 of 2 scenes"]
    assert len(cells) == 8
    assert cells[0].key == CellKey(planner="paper", scene="plain", seed=0)
    assert cells[-1].key == CellKey(planner="nearest-frontier", scene="furnished", seed=1)
    assert cells[0].scene.lower_m == pytest.approx((-3, -2), abs=2e-3)
    paper, frontier, elsewhere = (cells[index].fingerprint for index in (0, 1, 4))
    assert paper.settings["limits"]["max_time_s"] == 15
    assert paper.scene == frontier.scene == scene_digest(open_scene(request.scenes[0]))
    assert differences(paper, paper) == []
    assert any("planner.method was 'hierarchical'" in line for line in differences(paper, frontier))
    assert [line.split()[0] for line in differences(paper, elsewhere)] == ["scene"]


def test_many_scenes_are_opened_beside_each_other(tmp_path: Path) -> None:
    """In their order, and with what one by one gives; the first that cannot be opened is named."""
    paths = [tmp_path / f"room{number}.glb" for number in range(9)]
    for number, path in enumerate(paths):
        y_up(textured(with_boxes(((0.1 * number, 0.5, 0.0), (1.5, 1.2, 0.8))))).export(path)
    cells = plan_cells(asked(tmp_path, ["paper"], [0], [str(path) for path in paths])[0])
    assert [cell.scene.name for cell in cells] == [path.stem for path in paths]
    assert [cell.fingerprint.scene for cell in cells] == [
        scene_digest(open_scene(str(path))) for path in paths
    ]
    paths[4].write_bytes(b"no mesh")
    with pytest.raises(SceneError, match=r"room4\.glb"):
        plan_cells(asked(tmp_path, ["paper"], [0], [str(path) for path in paths])[0])


def test_scenes_of_one_name_are_refused(tmp_path: Path) -> None:
    paths = [tmp_path / folder / "room.glb" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        y_up(textured(room())).export(path)
    request, _ = asked(tmp_path, scenes=[str(path) for path in paths])
    with pytest.raises(ConfigError, match=r"both called room: rename one"):
        plan_cells(request)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"planners": ["paper", "papier"]}, "no planner preset 'papier'"),
        ({"seeds": [1, 1]}, "none twice"),
        ({"scenes": []}, "at least one"),
        ({"overrides": {"planner": "paper"}}, "--planners"),
        ({"overrides": {"planner.horizon": "3"}}, "horizon"),
    ],
)
def test_wrong_requests_are_told_before_anything_runs(tmp_path: Path, change: dict, told: str) -> None:
    right = {"scenes": ["house"], "planners": ["paper"], "seeds": [0], "preset": "robust", "overrides": {}}
    with pytest.raises(ConfigError, match=told):
        plan_cells(GridRequest(**{**right, **change}, out=tmp_path))
