"""What holds for every planner that is registered and for every planner preset, whoever adds it."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hgs_core.config.presets import load_preset, preset_names
from hgs_core.planning.plan import CandidateStatus, NothingLeft, Plan, Planner
from hgs_core.planning.registry import build_planner, planner_config, planner_method, planner_methods
from tests.planning.closed_loop import context_in, run_mission
from tests.planning.closed_world import ClosedWorld, PointRobot, new_voxels, three_rooms
from tests.planning.recorded_maps import PLANNED_FOR, Recording, play_back, record, save
from tests.planning.replan_recorded import GROUND_TRUTH

PRESETS = preset_names("planner")
START = (1.5, 1.2, 0.0)


@pytest.fixture(scope="module")
def world() -> ClosedWorld:
    return three_rooms()


@pytest.fixture(scope="module")
def recordings(world: ClosedWorld) -> list[Recording]:
    """After the first look around, in the second room, and when a coverage planner has nothing left."""
    robot = PointRobot(world, new_voxels(world), *START)
    for yaw in np.radians([0.0, 90.0, 180.0, 270.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
    kept = [record(robot)]
    scout = build_planner(planner_config(load_preset("planner", "coverage")), context_in(world.region))
    on_the_way: list[Recording] = []

    def record_in_second_room(robot: PointRobot, plan: Plan) -> None:
        if not on_the_way and robot.x_m > world.wall_m[0]:
            on_the_way.append(record(robot))

    mission = run_mission(world, seed=0, start=START, planner=scout, on_plan=record_in_second_room)
    assert mission.answer is not None
    return [*kept, *on_the_way, record(mission.robot)]


@pytest.fixture(scope="module")
def replanned(
    recordings: list[Recording], repository: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Any]:
    """Every preset's answers to the recordings, planned where no ground truth can be imported."""
    folder = tmp_path_factory.mktemp("recorded")
    save(recordings, folder / "recordings")
    module = "tests.planning.replan_recorded"
    subprocess.run(
        [sys.executable, "-m", module, str(folder / "recordings"), str(folder / "answers"), *PRESETS],
        cwd=repository,
        check=True,
    )
    replies: dict[str, Any] = json.loads((folder / "answers").read_text())
    return replies


def built(preset: str, world: ClosedWorld) -> Planner:
    context = replace(context_in(world.region), camera=PLANNED_FOR)
    return build_planner(planner_config(load_preset("planner", preset)), context)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_resolves_and_builds(preset: str, world: ClosedWorld) -> None:
    planner = built(preset, world)
    assert isinstance(planner, Planner)
    assert planner_config(load_preset("planner", preset)).method in planner_methods()


@pytest.mark.parametrize("name", planner_methods())
def test_a_planner_has_a_preset_and_goes_by_the_name_it_is_registered_under(name: str) -> None:
    assert planner_method(name).config.model_fields["method"].default == name
    assert name in {load_preset("planner", preset).get("method") for preset in PRESETS}


def test_no_ground_truth_is_loaded_or_can_be(replanned: dict[str, Any], repository: Path) -> None:
    assert replanned["ground_truth_loaded"] == []
    assert sorted(replanned["answers"]) == PRESETS
    for name in GROUND_TRUTH:
        program = (
            "import sys; from tests.planning.replan_recorded import NoGroundTruth;"
            f"sys.meta_path.insert(0, NoGroundTruth()); import {name}"
        )
        refused = subprocess.run(
            [sys.executable, "-c", program], cwd=repository, capture_output=True, text=True, check=False
        )
        assert "is ground truth" in refused.stderr


@pytest.mark.parametrize("preset", PRESETS)
def test_recorded_maps_are_all_that_a_planner_needs(
    preset: str, replanned: dict[str, Any], recordings: list[Recording]
) -> None:
    answers = replanned["answers"][preset]
    assert len(answers) == len(recordings)
    assert answers[0]["kind"] == "Plan", "two rooms of three are still to be seen"
    for answer in answers:
        assert len(answer["reason"].split()) > 3
        gains = np.array([candidate[2:5] for candidate in answer["candidates"]])
        assert np.isfinite(gains).all()
        assert np.all(gains >= 0.0)
        if answer["kind"] == "NothingLeft":
            assert CandidateStatus.SELECTED not in {candidate[5] for candidate in answer["candidates"]}
            assert "nothing is missing" in answer["reason"] or len(answer["unseen"]) > 0
        else:
            check_path(answer)


def check_path(plan: dict[str, Any]) -> None:
    """It begins at the robot, leads to a view that was chosen, and keeps the robot's radius."""
    assert plan["positions_m"][0] == plan["robot_m"]
    assert plan["n_views"] >= 1
    chosen = {tuple(np.round(c[:2], 6)) for c in plan["candidates"] if c[5] in ("selected", "crossing")}
    assert tuple(np.round(plan["positions_m"][-1], 6)) in chosen
    assert np.min(plan["clearance_m"]) >= plan["radius_m"] - 1e-6


@pytest.mark.parametrize("preset", PRESETS)
def test_a_state_is_plain_and_a_restored_planner_goes_on_alike(
    preset: str, world: ClosedWorld, recordings: list[Recording]
) -> None:
    first, second = built(preset, world), built(preset, world)
    first.plan(*play_back(recordings[0]), np.random.default_rng(0))
    state = first.state()
    assert_plain(state)
    second.restore(state)
    for recording in recordings[1:]:
        one = first.plan(*play_back(recording), np.random.default_rng(1))
        two = second.plan(*play_back(recording), np.random.default_rng(1))
        assert_same_answer(one, two)
        assert_same(first.state(), second.state())


def assert_plain(value: Any) -> None:
    """Dictionaries with string keys, lists, strings, numbers and arrays: what msgpack can carry."""
    if isinstance(value, dict):
        for key, inner in value.items():
            assert isinstance(key, str), key
            assert_plain(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            assert_plain(inner)
    elif isinstance(value, np.ndarray):
        assert value.dtype != object
    else:
        assert value is None or type(value) in (str, int, float, bool), type(value)


def assert_same(one: Any, two: Any) -> None:
    assert type(one) is type(two)
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            assert_same(one[key], two[key])
    elif isinstance(one, list | tuple):
        assert len(one) == len(two)
        for left, right in zip(one, two, strict=True):
            assert_same(left, right)
    else:
        np.testing.assert_array_equal(one, two)


def assert_same_answer(one: Plan | NothingLeft, two: Plan | NothingLeft) -> None:
    assert type(one) is type(two)
    assert one.reason == two.reason
    assert one.candidates == two.candidates
    assert one.subspaces == two.subspaces
    if isinstance(one, Plan) and isinstance(two, Plan):
        np.testing.assert_array_equal(one.path.positions_m, two.path.positions_m)
        np.testing.assert_array_equal(one.path.yaws_rad, two.path.yaws_rad)
