"""A car's ways between random poses: the benchmark tells what is so."""

import pytest

from hgs_core.benchmark.paths import PathBenchmark, run_path_benchmark
from hgs_core.errors import ConfigError
from hgs_core.planning.car_ways import KinodynamicConfig
from hgs_core.planning.navigation_grid import NavigationConfig
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.simulation import body
from hgs_core.simulation.footprint import Disc


def measured(pairs: int = 4, scenes: tuple[str, ...] = ("warren:1",), **car) -> PathBenchmark:
    return run_path_benchmark(
        scenes,
        pairs=pairs,
        seed=3,
        car=AckermannConfig(**car),
        navigation=NavigationConfig(),
        search=KinodynamicConfig(),
    )


@pytest.fixture(scope="module")
def figures() -> PathBenchmark:
    return measured(pairs=5, scenes=("warren:1", "warren:2"))


def test_ways_are_found_keep_their_turns_and_touch_nothing(figures):
    assert figures.pairs == 5
    assert figures.found == figures.within_reach == figures.found_within_reach == 5
    assert figures.missed == []
    assert figures.touching == 0
    assert figures.tightest_turn_share <= 1.0
    assert figures.length_to_astar.median >= 0.95, "a way that turns is no shorter than one that need not"
    assert figures.length_to_astar.max <= 3.0
    assert figures.failed_query_ms is None


def test_the_same_seed_asks_the_same(figures):
    again = measured(pairs=5, scenes=("warren:1", "warren:2"))
    assert again.length_m == figures.length_m
    assert again.length_to_astar == figures.length_to_astar


def test_a_car_that_hardly_turns_finds_fewer_ways_and_that_is_told():
    figures = measured(max_steering_deg=3.0)
    assert figures.found < figures.pairs == 4
    assert figures.failed_query_ms is not None
    assert len(figures.missed) == figures.within_reach - figures.found_within_reach


def test_a_body_wider_than_was_planned_for_touches(monkeypatch):
    """The check is against the true obstacles, not against the planner's grid."""
    monkeypatch.setattr(body, "footprint_of", lambda config: Disc(reach_m=1.0))
    figures = measured(pairs=2)
    assert figures.touching == figures.found > 0


def test_too_few_pairs_are_refused():
    with pytest.raises(ConfigError, match="1 pairs are fewer than the 2 scenes"):
        measured(pairs=1, scenes=("warren:1", "warren:2"))
