"""`hgs bench reference` in a room of four walls."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli.application import application
from tests.app.test_cli_evaluate import write_room


def hgs(*arguments: str):
    return CliRunner().invoke(application, list(arguments))


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path / "cache"))
    path = tmp_path / "room.ply"
    write_room(path)
    return path


def test_a_room_is_seen_from_where_one_stands_and_little_more(room: Path, tmp_path: Path) -> None:
    """4 x 3 m, from its middle: half of it is seen without a step; nine tenths within a walk around it."""
    out = tmp_path / "paths.json"
    result = hgs(
        *("bench", "reference", "--scene", str(room), "--set", "threads=1", "--json", str(out)),
        *("--level", "0.9", "--level", "0.5"),
    )
    assert result.exit_code == 0, result.output
    half, most = json.loads(out.read_text())["routes"]
    assert (half["level"], most["level"]) == (0.5, 0.9)
    assert half["length_m"] == pytest.approx(0.0, abs=0.18)
    assert len(half["looks"]) > 1
    assert half["length_m"] < most["length_m"] < 2 * (4 + 3)
    assert "90%" in result.stdout
    assert f"{most['length_m']:.1f} m" in result.stdout


def test_more_than_can_be_seen_is_refused(room: Path) -> None:
    assert hgs("bench", "reference", "--scene", str(room), "--level", "1.5").exit_code == 2
    result = hgs("bench", "reference", "--scene", str(room.with_name("absent.ply")))
    assert result.exit_code == 2
    assert "absent.ply" in result.stderr
