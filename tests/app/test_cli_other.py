"""`hgs presets`, `hgs scenes`, `hgs serve`, `hgs --version`."""

import socket
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.benchmark.paths import PathBenchmark
from hgs_core.config.presets import preset_names
from tests.scene.scans import hm3d
from tests.scene.worlds import room

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def hgs(*arguments: str):
    return CliRunner().invoke(application, list(arguments))


def test_version() -> None:
    assert hgs("--version").stdout.strip() == f"hgs {version('hgs')}"


def test_no_command_shows_help() -> None:
    told = hgs().output
    for command in ("run", "evaluate", "refine", "report", "mesh", "scenes", "presets", "serve"):
        assert command in told


def test_every_preset_is_listed_and_resolves() -> None:
    listed = hgs("presets").stdout
    for name in preset_names("mission"):
        assert name in listed
        shown = hgs("presets", name)
        assert shown.exit_code == 0
        assert "robot" in yaml.safe_load(shown.stdout)


def test_presets_show_what_a_setting_changes() -> None:
    shown = hgs("presets", "paper", "--set", "threads=1", "--set", "robot.radius_m=0.2")
    content = yaml.safe_load(shown.stdout)
    assert (content["threads"], content["robot"]["radius_m"]) == (1, 0.2)
    assert hgs("presets", "papier").exit_code == 2
    assert hgs("presets", "--set", "threads=1").exit_code == 2


def test_built_in_scenes_are_listed() -> None:
    result = hgs("scenes")
    assert result.exit_code == 0
    assert "house:SEED" in result.stdout


def test_scans_are_listed_and_placed_as_told(tmp_path: Path) -> None:
    listed = " ".join(hgs("scenes").stdout.split())
    for kind in ("Matterport3D scan", "HM3D scan", "Replica scene", "textured mesh"):
        assert kind in listed
    scan = str(hm3d(tmp_path, room(), forms=("glb",)))
    placed = hgs("scenes", scan, "--set", "start.x_m=-1.5", "--set", "scene.start.y_m=0.5")
    assert placed.exit_code == 0
    assert "(-1.50, 0.50) m" in placed.stdout
    wrong = hgs("scenes", scan, "--set", "up=z")
    assert wrong.exit_code == 2
    assert "scene.up = 'z'" in wrong.stderr


def test_facts_of_a_scene(shared_dir: Path) -> None:
    result = hgs("scenes", str(shared_dir / "scenes" / "pal_home.glb"))
    assert result.exit_code == 0
    for fact in ("15.25 x 17.50 x 2.51 m", "9,116 triangles", "12 textures", "(0.34, -4.58)"):
        assert fact in result.stdout


def test_a_scene_that_cannot_serve_says_why(tmp_path: Path) -> None:
    small = tmp_path / "small.obj"
    small.write_text(TETRAHEDRON)
    result = hgs("scenes", str(small), str(tmp_path / "absent.glb"))
    assert result.exit_code == 2
    assert f"{small}: " in result.stderr
    assert "absent.glb" in result.stderr


def test_serve_passes_its_options_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from app import main

    calls = []
    monkeypatch.setattr(main, "serve", calls.append)
    monkeypatch.setenv("HGS_DATA_DIR", str(tmp_path / "named"))
    result = hgs("serve", "--port", "8123", "--demo", "--missions-at-once", "2")
    assert result.exit_code == 0, result.stderr
    assert "http://127.0.0.1:8123" in result.stderr
    (settings,) = calls
    assert (settings.host, settings.port, settings.demo) == ("127.0.0.1", 8123, True)
    assert (settings.data_dir, settings.missions_at_once) == (tmp_path / "named", 2)
    assert hgs("serve", "--data-dir", str(tmp_path / "given")).exit_code == 0
    assert calls[1].data_dir == tmp_path / "given"


def test_serve_says_that_its_address_is_taken(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        result = hgs("serve", "--port", str(port), "--data-dir", str(tmp_path))
    assert result.exit_code == 4
    assert "in use" in result.stderr


def test_serve_refuses_an_address_that_others_can_reach(tmp_path: Path) -> None:
    result = hgs("serve", "--host", "0.0.0.0", "--data-dir", str(tmp_path))
    assert result.exit_code == 2
    assert "0.0.0.0" in result.stderr


def test_ways_of_a_car_are_measured(tmp_path: Path) -> None:
    ways = ("bench", "paths", "--scenes", "warren:1", "--pairs", "2")
    told = hgs(*ways, "--json", str(tmp_path / "paths.json"))
    assert told.exit_code == 0, told.output
    assert "2 pairs in 1 scenes: a way for 2 (100.0%)" in " ".join(told.stdout.split())
    assert PathBenchmark.model_validate_json((tmp_path / "paths.json").read_text()).found == 2
    refused = hgs(*ways, "--robot", "wheeled")
    assert refused.exit_code == 2
    assert "its drive is differential" in " ".join(refused.output.split())
