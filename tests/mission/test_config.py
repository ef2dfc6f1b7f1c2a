"""Presets resolve, overrides apply, mistakes are named."""

import pytest

from hgs_core.config.presets import load_preset, preset_names
from hgs_core.errors import ConfigError
from hgs_core.mission.config import resolve_mission_config


@pytest.mark.parametrize("preset", preset_names("mission"))
def test_every_preset_is_valid(preset: str) -> None:
    config = resolve_mission_config(preset, {})
    assert config.description
    assert config.robot.radius_m == 0.25


def test_the_papers_variants_differ_in_their_gains_alone() -> None:
    paper = resolve_mission_config("paper", {})
    coverage = resolve_mission_config("coverage", {})
    quality = resolve_mission_config("quality", {})
    assert paper.planner.gain.use_coverage
    assert paper.planner.gain.use_quality
    assert paper.planner.gain.adaptive
    assert not coverage.planner.gain.use_quality
    assert not quality.planner.gain.use_coverage
    for variant in (coverage, quality):
        assert variant.planner.model_copy(update={"gain": paper.planner.gain}) == paper.planner
        assert variant.mapping == paper.mapping


def test_overrides_reach_into_sections() -> None:
    config = resolve_mission_config(
        "paper", {"mapping.iterations_per_s": "3", "robot.radius_m": "0.3", "threads": "1"}
    )
    assert config.mapping.iterations_per_s == 3
    assert config.robot.radius_m == 0.3
    assert config.threads == 1


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("mapping.iterations", "3", r"mapping\.iterations"),
        ("robot.radius_m", "-1", r"robot\.radius_m = -1.*greater than 0"),
        ("threads.x", "1", "threads"),
        ("limits.max_time_s", "soon", r"limits\.max_time_s = 'soon'"),
    ],
)
def test_a_wrong_override_names_field_value_and_rule(key: str, value: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        resolve_mission_config("paper", {key: value})


def test_an_unknown_preset_lists_what_there_is() -> None:
    with pytest.raises(ConfigError, match="paper"):
        resolve_mission_config("papre", {})


@pytest.mark.parametrize("planner", preset_names("planner"))
def test_another_planner_takes_the_place_of_the_presets(planner: str) -> None:
    config = resolve_mission_config("quick", {"planner": planner, "planner.recheck_interval_s": "2"})
    assert config.planner.recheck_interval_s == 2
    assert config.mapping == resolve_mission_config("quick", {}).mapping
    assert load_preset("planner", planner)["description"]


def test_an_unknown_planner_lists_what_there_is() -> None:
    with pytest.raises(ConfigError, match="naruto"):
        resolve_mission_config("paper", {"planner": "narutto"})


@pytest.mark.parametrize(
    "text",
    ["[", "\x99", "2001-99-99", "[" * 3000, "{a: &a [1], b: *a}", "!!python/object:os.system {}", "? : ["],
)
def test_a_value_that_yaml_cannot_read_is_named(text):
    with pytest.raises(ConfigError, match=r"limits\.max_time_s"):
        resolve_mission_config("quick", {"limits.max_time_s": text})
