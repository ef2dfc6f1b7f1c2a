"""`hgs refine` on the folder of a short mission: better pictures, whole files, and a report that says so."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.errors import ConfigError, MapError
from hgs_core.evaluation.report import MissionReport
from hgs_core.gaussians.ply import read_ply
from hgs_core.gaussians.render import render
from hgs_core.mapping.keyframe_archive import KeyframeArchive
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.finished_run import FinishedRun
from hgs_core.mission.refine import RefinementProgress, refine_run
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.run import run_mission
from tests.mission.stop_after import StopAfter

SMALL_CAMERA = {
    "threads": "1",
    "sensor.camera.width": "240",
    "sensor.camera.height": "136",
    "sensor.camera.focal_px": "120",
    "mapping.iterations_per_s": "2.5",
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("refine") / "run"
    stop = StopAfter(40)
    request = MissionRequest(
        scene="house", preset="quick", seed=0, out=folder, max_time_s=20.0, overrides=SMALL_CAMERA
    )
    run_mission(request, observer=stop, commands=stop)
    return folder


@pytest.fixture
def run_folder(finished: Path, tmp_path: Path) -> Path:
    shutil.copytree(finished, tmp_path / "run")
    return tmp_path / "run"


def config_of(folder: Path) -> MissionConfig:
    return FinishedRun.open(folder).config


def refine(folder: Path, *, steps: int) -> list[RefinementProgress]:
    """So many steps, ended by hand long before the time is over."""
    seen: list[RefinementProgress] = []
    refine_run(
        folder,
        config_of(folder),
        time_s=1000.0,
        progress=seen.append,
        interrupted=lambda: len(seen) >= steps,
    )
    return seen


def colour_error(folder: Path) -> float:
    keyframes, gaussians = KeyframeArchive.open(folder), read_ply(folder / "map.ply")
    errors = []
    for index in range(len(keyframes)):
        image = keyframes.load(index)
        view = render(gaussians, image.intrinsics, image.T_world_camera)
        errors.append(np.abs(view.colour - image.rgb / 255.0)[image.measured].mean())
    return float(np.mean(errors))


def test_more_steps_make_better_pictures(run_folder: Path) -> None:
    before = colour_error(run_folder)
    progress = refine(run_folder, steps=60)
    assert colour_error(run_folder) < 0.8 * before
    assert [done.steps for done in progress] == list(range(1, 61))
    assert progress[-1].colour_l1 < progress[0].colour_l1


def test_an_interrupted_refinement_keeps_what_it_reached_and_says_so(run_folder: Path) -> None:
    map_before = (run_folder / "map.ply").read_bytes()
    content = json.loads((run_folder / "report.json").read_text())
    content |= {"psnr_db": 20.0, "accuracy_cm": 0.5, "accuracy_cm_mesh": 0.7, "observable_fraction": 0.6}
    (run_folder / "report.json").write_text(json.dumps(content))
    refine(run_folder, steps=2)
    refine(run_folder, steps=3)
    assert (run_folder / "map.ply").read_bytes() != map_before
    report = MissionReport.read(run_folder / "report.json")
    assert report.refinement is not None
    assert report.refinement.steps == 5
    assert report.refinement.seconds > 0
    # Figures of the map as the mission left it are kept as such, and no others are claimed.
    assert (report.refinement.psnr_db_before, report.refinement.accuracy_cm_before) == (20.0, 0.5)
    assert (report.psnr_db, report.accuracy_cm) == (None, None)
    assert (report.accuracy_cm_mesh, report.observable_fraction) == (0.7, 0.6)
    assert not list(run_folder.glob(".*.partial"))


def test_the_command_refines_and_shows_the_report(run_folder: Path) -> None:
    result = CliRunner().invoke(application, ["refine", str(run_folder), "--time", "0.5", "--no-evaluation"])
    assert result.exit_code == 0, result.output
    assert "house" in result.stdout
    entry = MissionReport.read(run_folder / "report.json").refinement
    assert entry is not None
    assert entry.seconds >= 0.5


def test_what_is_missing_is_named_and_nothing_is_rewritten(run_folder: Path) -> None:
    before = (run_folder / "map.ply").read_bytes()
    with pytest.raises(ConfigError, match="time_s must be more than 0"):
        refine_run(
            run_folder,
            config_of(run_folder),
            time_s=0.0,
            progress=lambda done: None,
            interrupted=lambda: False,
        )
    (run_folder / "transforms.json").unlink()
    with pytest.raises(MapError, match=r"transforms\.json"):
        refine(run_folder, steps=1)
    result = CliRunner().invoke(application, ["refine", str(run_folder), "--time", "1"])
    assert result.exit_code == 2
    assert "transforms.json" in result.stderr
    assert (run_folder / "map.ply").read_bytes() == before
