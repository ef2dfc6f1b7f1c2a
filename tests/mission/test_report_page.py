"""The page of a run, made from its folder: self-contained, complete, and right about which views it shows."""

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.mapping.mesh_file import read_mesh
from hgs_core.mission.request import MissionRequest
from hgs_core.mission.run import run_mission
from hgs_core.mission.shown_views import _best_median_worst
from tests.mission.stop_after import StopAfter

VOID = {"meta", "img"}


class WellFormed(HTMLParser):
    """Every element that is opened is closed, in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mission of few frames with a small camera, stopped, so without any evaluation."""
    folder = tmp_path_factory.mktemp("report") / "run"
    settings = {
        "threads": "1",
        "mapping.iterations_per_s": "2.5",
        "sensor.camera.width": "240",
        "sensor.camera.height": "136",
        "sensor.camera.focal_px": "120",
    }
    stop = StopAfter(12)
    request = MissionRequest(
        scene="house", preset="quick", seed=0, out=folder, max_time_s=20.0, overrides=settings
    )
    run_mission(request, observer=stop, commands=stop)
    return folder


def test_the_page_stands_alone_and_is_well_formed(run_folder: Path) -> None:
    content = (run_folder / "report.html").read_text()
    page = WellFormed()
    page.feed(content)
    assert page.open == []
    assert "script" not in page.tags
    assert "link" not in page.tags
    sources = [value or "" for name, value in page.attributes if name in ("src", "href")]
    assert sources
    assert all(source.startswith("data:image/jpeg;base64,") for source in sources)
    assert not re.search(r"https?:|url\(|@import", content)
    assert "prefers-color-scheme: dark" in content


def test_an_unevaluated_run_shows_keyframes_and_says_so(run_folder: Path) -> None:
    content = (run_folder / "report.html").read_text()
    assert "no held-out views" in content
    assert "Ended: interrupted" in content
    for title in ("Best view", "Worst view", "quality gain, logarithmic", "absolute colour error"):
        assert title in content
    for reason in ("Observed volume over the path", "T_P, each planning cycle", "What stayed unseen"):
        assert reason in content


def test_the_page_is_the_same_when_made_again_from_the_folder(run_folder: Path) -> None:
    before = (run_folder / "report.html").read_text()
    (run_folder / "report.html").unlink()
    result = CliRunner().invoke(application, ["report", str(run_folder)])
    assert result.exit_code == 0, result.output
    assert (run_folder / "report.html").read_text() == before


def test_a_mesh_is_made_from_the_folder(run_folder: Path) -> None:
    assert not (run_folder / "mesh.ply").exists()  # a mission that is stopped ends at once
    result = CliRunner().invoke(application, ["mesh", str(run_folder), "--voxel-size", "0.05"])
    assert result.exit_code == 0, result.output
    mesh = read_mesh(run_folder / "mesh.ply")
    assert len(mesh.triangles) > 1000
    assert np.all(np.abs(mesh.vertices_m[:, 2] - 1.3) < 1.6)  # between the house's floor and ceiling


@pytest.mark.parametrize("command", ["report", "mesh"])
def test_what_is_no_run_is_named(tmp_path: Path, command: str) -> None:
    result = CliRunner().invoke(application, [command, str(tmp_path)])
    assert result.exit_code == 2
    assert str(tmp_path) in result.stderr.replace("\n", "")


def test_best_median_and_worst_of_as_many_as_there_are() -> None:
    assert _best_median_worst([3.0, 9.0, 1.0, 5.0, 4.0]) == [("best", 1), ("median", 4), ("worst", 2)]
    assert _best_median_worst([3.0, 9.0]) == [("best", 1), ("worst", 0)]
    assert _best_median_worst([3.0]) == [("best", 0)]
    assert _best_median_worst([]) == []
