"""Presets are found by name, and what cannot be found is answered with what there is."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgs_core.config.presets import load_preset, load_yaml, preset_names, presets_root
from hgs_core.errors import ConfigError


def test_every_preset_of_every_subject_loads() -> None:
    subjects = [path.name for path in presets_root().iterdir() if path.is_dir()]
    assert "mission" in subjects
    for subject in subjects:
        for name in preset_names(subject):
            assert load_preset(subject, name)


def test_the_presets_of_the_comparison_are_there() -> None:
    assert {"paper", "coverage", "quality"} <= set(preset_names("mission"))


def test_an_unknown_preset_names_what_there_is() -> None:
    with pytest.raises(ConfigError, match=r"no mission preset 'papre'; there are: .*paper"):
        load_preset("mission", "papre")


def test_an_unknown_subject_names_what_there_is() -> None:
    with pytest.raises(ConfigError, match=r"'weather'; .*mission"):
        load_preset("weather", "rain")


@pytest.mark.parametrize("name", ["../sensor/rgbd_5m", "/etc/hostname", "", ".", "paper.yaml", "paper\0"])
def test_a_name_is_not_a_path(name: str) -> None:
    with pytest.raises(ConfigError, match="no mission preset"):
        load_preset("mission", name)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"a: [1", "not valid YAML"),
        (b"\xff\xfe\xff", "not valid YAML"),
        (b"- 1\n- 2", "list"),
        (b"", "NoneType"),
    ],
)
def test_a_file_that_holds_no_mapping_is_refused(tmp_path: Path, content: bytes, complaint: str) -> None:
    path = tmp_path / "broken.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=complaint):
        load_yaml(path)


def test_a_file_that_is_missing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read"):
        load_yaml(tmp_path / "missing.yaml")


def test_yaml_cannot_run_code(tmp_path: Path) -> None:
    path = tmp_path / "hostile.yaml"
    path.write_text("a: !!python/object/apply:os.getcwd []\n")
    with pytest.raises(ConfigError, match="not valid YAML"):
        load_yaml(path)
