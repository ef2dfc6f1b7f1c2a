"""What the operator asks holds for planners and for the mission's own ways."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.polygons import contains, distance_m
from hgs_core.mapping.snapshot import MapSnapshot
from hgs_core.planning.config import HierarchicalConfig
from hgs_core.planning.directives import Directives
from hgs_core.planning.focus import Focus
from hgs_core.planning.navigator import AT_GOAL_M, Navigator
from hgs_core.planning.path_search import reach_from
from hgs_core.planning.plan import NothingLeft, Plan, Planner, UnseenReason
from hgs_core.planning.zones import TOLERANCE_M, Zones
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotState
from hgs_core.voxels.voxel_map import VoxelMap, VoxelState
from tests.planning.baselines.worlds import gain_first, gs_planner, random_views
from tests.planning.closed_loop import ClosedMission, new_planner, run_mission
from tests.planning.closed_world import ClosedWorld, PointRobot, new_voxels, three_rooms
from tests.planning.floors import grid_of, room

RADIUS_M = DifferentialConfig().radius_m
START = (1.5, 1.2, 0.0)
START_M = np.array(START[:2])
PLANNERS: dict[str, Callable[[ClosedWorld], Planner]] = {
    "paper": new_planner,
    "best": gain_first,
    "gs-planner": gs_planner,
    "random": random_views,
}
ROOM_B = ((3.6, 0.1), (6.9, 0.1), (6.9, 3.4), (3.6, 3.4))
IN_B = ((4.3, 0.8), (5.2, 0.8), (5.2, 1.4), (4.3, 1.4))
"""An area beside the way through B."""


def quads(lower: float, upper: float) -> st.SearchStrategy[tuple[tuple[float, float], ...]]:
    """Rectangles at any angle."""

    def of(x: float, y: float, a: float, b: float, turn: float) -> tuple[tuple[float, float], ...]:
        u, v = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
        middle = np.array([x, y])
        corners = [middle + s * a * u + t * b * v for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return tuple((float(c[0]), float(c[1])) for c in corners)

    place, size = st.floats(lower, upper), st.floats(0.1, 0.8)
    return st.builds(of, place, place, size, size, st.floats(0, np.pi))


def standing(x_m: float, y_m: float, length_m: float = 0.0) -> RobotState:
    return RobotState(x_m=x_m, y_m=y_m, yaw_rad=0.0, timestamp_s=0.0, path_length_m=length_m, collisions=0)


def snapshot_of(voxels: VoxelMap) -> MapSnapshot:
    return MapSnapshot(gaussians=GaussianMap(), voxels=voxels, version=voxels.version, timestamp_s=0.0)


def navigator(**asked: object) -> Navigator:
    found = Navigator(HierarchicalConfig(), DifferentialConfig())
    found.obey(Directives.model_validate(asked))
    return found


def points_along(path: Path) -> np.ndarray:
    shares = np.linspace(0.0, 1.0, 60)[:, None]
    legs = zip(path.positions_m[:-1], path.positions_m[1:], strict=True)
    return np.concatenate([path.positions_m[:1], *(a + shares * (b - a) for a, b in legs)])


def cluttered(boxes: list[tuple[int, int, int, int]]) -> VoxelMap:
    voxels = room(60, 60)
    for i, j, width, depth in boxes:
        voxels.states[i : i + width, j : j + depth, :12] = VoxelState.OCCUPIED
    voxels.note_change()
    return voxels


box = st.tuples(st.integers(5, 50), st.integers(5, 50), st.integers(1, 8), st.integers(1, 8))


@settings(deadline=None, max_examples=40)
@given(
    boxes=st.lists(box, max_size=4),
    areas=st.lists(quads(1.5, 5.5), min_size=1, max_size=3),
    goal=st.tuples(st.floats(0.5, 5.5), st.floats(0.5, 5.5)),
)
def test_no_way_comes_into_a_no_go_area(
    boxes: list[tuple[int, int, int, int]], areas: list, goal: tuple[float, float]
) -> None:
    voxels, at = cluttered(boxes), standing(0.8, 0.8)
    driver = navigator(no_go=areas)
    if driver.stands_in_no_go(at.x_m, at.y_m):
        return
    for way in (
        driver.way_to(snapshot_of(voxels), at, np.array(goal)),
        driver.way_back(snapshot_of(voxels), at, np.array(goal)),
        driver.way_to(snapshot_of(voxels), at, np.array(goal), 0.1),
    ):
        if way is None:
            continue
        assert not driver.enters_no_go(way)
        for area in areas:
            nearest = distance_m(np.array(area), points_along(way)).min()
            assert nearest >= RADIUS_M - TOLERANCE_M


@settings(deadline=None, max_examples=40)
@given(area=quads(2.0, 4.0), boxes=st.lists(box, max_size=3), at=st.tuples(st.floats(2, 4), st.floats(2, 4)))
def test_a_robot_inside_leaves_by_the_shortest_way(
    area: tuple, boxes: list[tuple[int, int, int, int]], at: tuple[float, float]
) -> None:
    voxels, state = cluttered(boxes), standing(*at)
    driver = navigator(no_go=[area])
    physical = grid_of(voxels, at)
    here = np.array(at)
    if not driver.stands_in_no_go(*at) or float(physical.path_clearance_m(here[None])[0]) < RADIUS_M:
        return
    way = driver.way_out(snapshot_of(voxels), state)
    if way is None:
        return
    end = way.positions_m[-1]
    assert not driver.stands_in_no_go(*end)
    assert np.all(physical.path_clearance_m(way.positions_m) >= RADIUS_M - 1e-3)
    reach = reach_from(physical, here)
    cells = np.flatnonzero(reach.reachable)
    outside = distance_m(np.array(area), physical.centres_m(cells)) >= RADIUS_M + 0.12
    straight = np.linalg.norm(physical.centres_m(cells[outside]) - here, axis=1)
    # Not much longer than the straight line to the nearest place outside, where nothing stands between.
    if not boxes:
        assert way.length_m <= 1.1 * straight.min() + 0.2


@settings(deadline=None, max_examples=30)
@given(area=quads(1.0, 5.0))
def test_every_column_that_an_area_touches_is_forbidden(area: tuple) -> None:
    voxels = room(60, 60)
    zones = Zones(Directives(no_go=(area,)))
    forbidden = zones.forbidden(voxels)
    assert forbidden is zones.forbidden(voxels)
    inner = np.random.default_rng(0).uniform(0.1, 5.9, (4000, 2))
    inner = inner[contains(np.array(area), inner)]
    columns = np.floor(inner / 0.1).astype(int)
    assert forbidden[tuple(columns.T)].all()


def test_lengths_are_those_of_the_ways() -> None:
    grid = grid_of(cluttered([(20, 0, 3, 40)]), (1.0, 1.0))
    reach = reach_from(grid, np.array([1.0, 1.0]))
    lengths = reach.lengths_m(grid)
    for cell in np.flatnonzero(reach.reachable)[::97].tolist():
        points = np.concatenate([[[1.0, 1.0]], grid.centres_m(reach.cells_to(cell))])
        assert lengths[cell] == pytest.approx(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    assert np.all(np.isinf(lengths[~reach.reachable.ravel()]))


def test_only_the_region_counts_in_focused_maps() -> None:
    world = three_rooms()
    robot = PointRobot(world, new_voxels(world), *START)
    inside = np.zeros(robot.voxels.states.shape[:2], bool)
    inside[:25] = True
    focus, focused = Focus(), None
    for yaw in np.radians([0.0, 120.0, 240.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
        before = focused
        focused = focus.on(robot.snapshot, inside)
        everywhere = robot.voxels.missing()
        np.testing.assert_array_equal(focused.voxels.missing(), _alone(robot.voxels, inside))
        assert 0 < focused.voxels.n_missing < everywhere.sum()
        assert before is None or focused.voxels is before.voxels
    assert not focused.voxels.missing()[25:].any()
    assert robot.voxels.attempts.max() <= robot.voxels.config.max_attempts + 10


def _alone(voxels: VoxelMap, inside: np.ndarray) -> np.ndarray:
    """The missing voxels of a map of its own in which the other columns have been dismissed."""
    other = VoxelMap.restore(voxels.state())
    other.attempts[~inside] = 255
    other.note_change()
    return other.missing()


def driven(
    name: str, asked: Directives, start: tuple[float, float, float] = START, max_plans: int = 60
) -> ClosedMission:
    world = three_rooms()
    planner = PLANNERS[name](world)
    planner.obey(asked, np.array(start[:2]))
    return run_mission(world, seed=0, start=start, planner=planner, max_plans=max_plans)


LONG = pytest.mark.slow
"""A closed mission takes seconds: one planner each stands for the others in the quick suite."""


@pytest.mark.parametrize(
    "name", ["best", *(pytest.param(name, marks=LONG) for name in PLANNERS if name != "best")]
)
def test_no_planner_drives_into_a_no_go_area(name: str) -> None:
    mission = driven(name, Directives(no_go=(IN_B,)), max_plans=12)
    trail = np.array(mission.robot.trail)[:, :2]
    assert trail[:, 0].max() > 3.6, "it goes on beside the area"
    assert distance_m(np.array(IN_B), trail).min() >= RADIUS_M - TOLERANCE_M


def test_what_a_no_go_area_hides_is_said_to_be_its_fault() -> None:
    door = ((3.2, 1.0), (4.0, 1.0), (4.0, 2.3), (3.2, 2.3))
    mission = driven("best", Directives(no_go=(door,)))
    assert mission.answer is not None
    trail = np.array(mission.robot.trail)[:, :2]
    assert trail[:, 0].max() < 3.5
    assert distance_m(np.array(door), trail).min() >= RADIUS_M - TOLERANCE_M
    reasons = {region.reason for region in mission.answer.unseen if region.volume_m3 > 0.1}
    assert UnseenReason.NO_GO in reasons
    assert UnseenReason.UNREACHABLE not in reasons


@pytest.mark.parametrize("name", ["paper", pytest.param("best", marks=LONG)])
def test_a_region_ends_a_mission_early_and_says_what_it_left(name: str) -> None:
    room_a = ((0.1, 0.1), (3.4, 0.1), (3.4, 3.4), (0.1, 3.4))
    mission = driven(name, Directives(region=room_a))
    assert mission.answer is not None
    assert contains(np.array(room_a), np.array(mission.views).reshape(-1, 3)[:, :2]).all()
    reasons = {region.reason for region in mission.answer.unseen}
    assert UnseenReason.OUTSIDE_REGION in reasons
    assert np.array(mission.robot.trail)[:, :2].max() < 3.6, "no other room was entered"


@LONG
def test_a_region_whose_way_is_not_known_yet_is_looked_for() -> None:
    mission = driven("best", Directives(region=ROOM_B))
    views = np.array(mission.views)[:, :2]
    inside = contains(np.array(ROOM_B), views)
    first = int(np.argmax(inside))
    assert inside[first:].all(), "once it is reached, no view is taken elsewhere"
    assert inside.sum() >= 2
    assert views[:, 1].max() < 3.6, "the room behind is none of its business"


@pytest.mark.parametrize(
    ("name", "back"),
    [
        ("best", True),
        *(pytest.param(name, back, marks=LONG) for name in ("paper", "random") for back in (False, True)),
    ],
)
def test_views_lie_within_the_path_budget(name: str, back: bool) -> None:
    asked = Directives(max_path_m=7.0, return_to_start=back)
    mission = driven(name, asked)
    assert isinstance(mission.answer, NothingLeft)
    robot = mission.robot
    assert robot.length_m <= 7.0
    reasons = {region.reason for region in mission.answer.unseen if region.volume_m3 > 0.1}
    assert UnseenReason.PATH_BUDGET in reasons
    if back:
        way = navigator().way_back(robot.snapshot, robot.state, START_M)
        assert way is not None
        assert np.linalg.norm(way.positions_m[-1] - START_M) <= AT_GOAL_M
        assert robot.length_m + way.length_m <= 7.0


def test_a_refused_view_is_not_proposed_again_until_its_surroundings_change() -> None:
    world = three_rooms()
    robot = PointRobot(world, new_voxels(world), *START)
    for yaw in np.radians([0.0, 90.0, 180.0, 270.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
    planner = gain_first(world)
    refused: list[tuple[float, float, float]] = []
    for _ in range(4):
        plan = planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
        assert isinstance(plan, Plan)
        at = int(np.flatnonzero(np.isfinite(plan.path.yaws_rad))[0])
        x_m, y_m = plan.path.positions_m[at].tolist()
        yaw_rad = float(plan.path.yaws_rad[at])
        for other_x, other_y, other_yaw in refused:
            turned = abs((yaw_rad - other_yaw + np.pi) % (2 * np.pi) - np.pi)
            assert np.hypot(x_m - other_x, y_m - other_y) >= 1.0 or turned >= np.radians(60.0)
        refused.append((x_m, y_m, yaw_rad))
        planner.refuse(robot.snapshot, x_m, y_m, yaw_rad)
    memory = planner._survey.memory
    assert memory.is_refused(*refused[0])
    robot.x_m, robot.y_m = refused[0][:2]
    for yaw in np.radians([0.0, 90.0, 180.0, 270.0]):
        robot.yaw_rad = float(yaw)
        robot.observe()
    robot.voxels.states[:, :34][robot.voxels.states[:, :34] == 0] = VoxelState.FREE
    robot.voxels.note_change()
    planner.plan(robot.snapshot, robot.state, np.random.default_rng(0))
    assert not memory.is_refused(*refused[0])
