"""The example package of docs/extending.md: installed elsewhere, found by name, and used in one mission."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from hgs_core.errors import ConfigError, SceneError
from hgs_core.evaluation.report import MissionReport
from hgs_core.gain.registry import build_evaluator
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.mission.config import resolve_mission_config
from hgs_core.scene.registry import scene_names
from hgs_core.scene.scene import open_scene

_EXAMPLE = Path(__file__).parent / "extension_example"
_FILES = sorted(path for path in _EXAMPLE.rglob("*") if path.suffix in (".py", ".toml"))
_PARTS = {
    "planner": "most-per-metre",
    "gain": "square-root",
    "scene": "corridor",
    "sensor": "dropout",
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the example was installed, offline; its source folder is left as it is."""
    root = tmp_path_factory.mktemp("extension")
    shutil.copytree(_EXAMPLE, root / "source")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install", "--no-index"]
    options = ["--no-deps", "--no-build-isolation", f"--target={root / 'target'}"]
    subprocess.run([*pip, *options, str(root / "source")], check=True)
    return root / "target"


def hgs(installed: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    program = "import sys; from app.cli import main; sys.argv[0] = 'hgs'; main()"
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(installed), *filter(None, sys.path)])},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_mission_is_made_of_all_four_parts(installed: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    settings = {
        "planner.gain.method": _PARTS["gain"],
        "sensor.camera.method": _PARTS["sensor"],
        "sensor.camera.lost_share": "0.3",
        "evaluate": "false",
        "threads": "1",
    }
    answer = hgs(
        installed,
        *("run", "--scene", "corridor:6", "--planner", _PARTS["planner"], "--preset", "robust"),
        *("--max-time", "8", "--out", str(out)),
        *(word for key, value in settings.items() for word in ("--set", f"{key}={value}")),
    )
    assert answer.returncode in (0, 3), answer.stderr  # complete, or the time was up
    report = MissionReport.model_validate_json((out / "report.json").read_text())
    assert (report.scene, report.planner) == ("corridor:6", "most-per-metre")
    assert report.frames > 10
    assert report.path_length_m
    mission = yaml.safe_load((out / "config.yaml").read_text())["mission"]
    assert mission["planner"]["method"] == "most-per-metre"
    assert mission["planner"]["gain"]["method"] == "square-root"
    assert mission["sensor"]["camera"]["lost_share"] == 0.3
    assert "the most for each metre" in (out / "events.jsonl").read_text()


def test_lists_and_messages_name_the_parts(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(installed))
    assert scene_names()["corridor"].startswith("an empty corridor of the given length")
    with pytest.raises(SceneError, match=r"'corridor:endless' is no corridor: expected corridor:LENGTH"):
        open_scene("corridor:endless")
    with pytest.raises(SceneError, match=r"corridor: corridor:LENGTH, a straight corridor"):
        open_scene("nowhere")
    for key, part in (("planner", "planner"), ("planner.gain", "gain"), ("sensor.camera", "sensor")):
        chosen = resolve_mission_config(
            "quick", {"planner": _PARTS["planner"], f"{key}.method": _PARTS[part]}
        )
        assert chosen.planner.method == _PARTS["planner"]
    for key, part in (("planner", "planner"), ("sensor.camera", "sensor")):
        with pytest.raises(ConfigError, match=rf"'nothing'; there are: .*{_PARTS[part]}"):
            resolve_mission_config("quick", {f"{key}.method": "nothing"})
    gain = GainConfig(method="nothing")
    with pytest.raises(ConfigError, match=r"no gain 'nothing'; there are: panorama, square-root"):
        build_evaluator(gain, CameraIntrinsics.centred(60, 34, 30.0), 5.0)


def test_the_corridor_is_a_world(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(installed))
    scene = open_scene("corridor:6")
    np.testing.assert_allclose(scene.bounds.size_m, [6, 2, 2.5], atol=5e-3)
    assert scene.mesh.areas_m2.sum() == pytest.approx(2 * (6 * 2 + 6 * 2.5 + 2 * 2.5))
    assert scene.notices == ()


@pytest.mark.parametrize("path", _FILES, ids=lambda path: path.name)
def test_the_document_shows_the_example_as_it_is(repository: Path, path: Path) -> None:
    text = (repository / "docs" / "extending.md").read_text(encoding="utf-8")
    language = {".py": "python", ".toml": "toml"}[path.suffix]
    assert f"```{language}\n{path.read_text(encoding='utf-8')}```\n" in text
    assert str(path.relative_to(repository)) in text
