"""Full-knowledge paths through buildings whose shortest covering path can be worked out."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import SceneError
from hgs_core.evaluation import full_knowledge as module
from hgs_core.evaluation.ceiling import CeilingRequest, observable_ceiling
from hgs_core.evaluation.full_knowledge import FullKnowledgePath, full_knowledge_path
from hgs_core.evaluation.looks import YAWS_RAD, Looks
from hgs_core.evaluation.observable import in_view_at_some_yaw
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.scene.ray_caster import RayCaster

NARROW = CameraIntrinsics(width=400, height=680, fx=600.0, fy=600.0, cx=200.0, cy=340.0)
"""Half a field of view: arctan(1 / 3) = 18.4 degrees across. Range reaches 5 / cos 18.4 = 5.27 m at most."""
FARTHEST_M = 5.0 / np.cos(np.arctan(1 / 3))


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path / "cache"))


def request(start_xy: tuple[float, float]) -> CeilingRequest:
    return CeilingRequest(
        start_xy=start_xy,
        robot_radius_m=0.25,
        robot_height_m=1.1,
        camera_height_m=1.0,
        intrinsics=NARROW,
        range_m=5.0,
        n_samples=6000,
    )


def found(caster: RayCaster, start_xy: tuple[float, float], levels: tuple[float, ...]) -> FullKnowledgePath:
    return full_knowledge_path(caster, request(start_xy), levels=levels, n_samples=3000, rounds=60)


def test_a_corridor(cast_boxes: Callable[..., RayCaster]) -> None:
    """20 x 2 m, from x = 0.5 m. To see the far end, one must come as near as the range allows, and from 5 m
    all of it is in sight: between 20 - 0.5 - 5.27 and 20 - 0.5 - 5 m, to a step of the grid. Half of the
    corridor's surface, seen from 5 m before its end: not more than half of the way."""
    corridor = cast_boxes([((0, 0, 0), (20, 2, 2.5))])
    half, whole = found(corridor, (0.5, 1.0), (0.5, 0.999)).routes
    assert 19.5 - FARTHEST_M <= whole.length_m <= 19.5 - 5.0 + 0.25
    assert half.length_m <= 5.25
    assert half.seen_share >= 0.5
    assert whole.seen_share >= 0.999


def test_an_l_shaped_building(cast_boxes: Callable[..., RayCaster]) -> None:
    """Two corridors of 2 m width: along x to 14 m, then along y to 14 m, around the inner corner at (12, 2).

    One drives around the corner until the far end is in range. With a robot of 0.25 m the shortest way there
    from (0.5, 1) to 5.27 m before the end touches the circle around the corner; it is a little longer than
    through the corner itself, and shorter than around the corner's square of 0.25 m.
    """
    building = cast_boxes([((0, 0, 0), (14, 14, 2.5)), ((0, 2, 0), (12, 14, 2.5))])
    (route,) = found(building, (0.5, 1.0), (0.999,)).routes
    least = np.hypot(12 - 0.5, 2 - 1) + (14 - FARTHEST_M - 2)
    most = np.hypot(12.25 - 0.5, 1.75 - 1) + (14 - 5 - 1.75) + 0.5
    assert least <= route.length_m <= most
    assert not any(x < 12 and y > 2 for x, y in route.route_m)


def test_the_looks_see_what_they_should(cast_boxes: Callable[..., RayCaster]) -> None:
    """Looks and frames straight ahead together see the level, counted afresh from the camera's rule."""
    building = cast_boxes([((0, 0, 0), (8, 6, 2.5)), ((3.9, 0, 0), (4.1, 4.8, 2.5))])
    result = found(building, (1.0, 1.0), (0.9,))
    (route,) = result.routes
    ceiling = observable_ceiling(building, request((1.0, 1.0)))
    observable = ceiling.samples_m[ceiling.observable]
    samples = observable[np.linspace(0, len(observable) - 1, result.n_samples).round().astype(int)]
    looks = Looks(building, samples, camera_height_m=1.0, intrinsics=NARROW, range_m=5.0)
    seen = np.zeros(len(samples), dtype=bool)
    for look in route.looks:
        seen |= looks.seen(np.array([look.x_m, look.y_m]), np.array([look.yaw_rad]))[0]
    places = np.array(route.route_m)
    for begin, end in pairwise(places):
        heading = np.arctan2(*(end - begin)[::-1])
        seen |= looks.seen(begin, np.array([heading]))[0] | looks.seen(end, np.array([heading]))[0]
    assert seen.mean() >= 0.9
    assert {(look.x_m, look.y_m) for look in route.looks} <= set(route.route_m)
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert route.length_m == pytest.approx(lengths.sum(), abs=1e-6)


def test_looks_agree_with_the_camera_model(empty_room: RayCaster) -> None:
    """Points projected into each image, and the rule for any heading as an outer bound."""
    rng = np.random.default_rng(0)
    samples = rng.uniform([0.05, 0.05, 0.05], [3.95, 2.95, 2.45], (500, 3))
    looks = Looks(empty_room, samples, camera_height_m=1.0, intrinsics=NARROW, range_m=2.0)
    position = np.array([1.0, 1.5])
    seen = looks.seen(position)
    eye = np.array([1.0, 1.5, 1.0])
    for yaw, row in zip(YAWS_RAD, seen, strict=True):
        z = (samples - eye) @ [np.cos(yaw), np.sin(yaw), 0]
        u = 200 - 600 * ((samples - eye) @ [-np.sin(yaw), np.cos(yaw), 0]) / z
        v = 340 - 600 * (samples[:, 2] - 1.0) / z
        inside = (z > 0) & (z <= 2.0) & (u >= 0) & (u <= 400) & (v >= 0) & (v <= 680)
        np.testing.assert_array_equal(row, inside)
    possible = in_view_at_some_yaw(samples, eye, intrinsics=NARROW, range_m=2.0)
    assert seen.any(axis=0)[possible].mean() > 0.95
    assert not seen.any(axis=0)[~possible].any()


def test_a_path_is_found_once(empty_room: RayCaster, monkeypatch: pytest.MonkeyPatch) -> None:
    first = found(empty_room, (1.0, 1.0), (0.9,))

    def forbidden(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(module, "covering_path", forbidden)
    assert found(empty_room, (1.0, 1.0), (0.9,)) == first
    with pytest.raises(AssertionError, match="computed again"):
        found(empty_room, (1.0, 1.0), (0.8,))


def test_a_damaged_cache_is_computed_again_and_said_so(
    empty_room: RayCaster, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = found(empty_room, (1.0, 1.0), (0.9,))
    (cached,) = (tmp_path / "cache").glob("full-knowledge-*.json")
    cached.write_text("{")
    assert found(empty_room, (1.0, 1.0), (0.9,)) == first
    assert "computing it again" in caplog.text


def test_a_start_in_a_wall_is_refused(divided_room: RayCaster) -> None:
    with pytest.raises(SceneError, match=r"the start \(3\.00, 1\.00\)"):
        found(divided_room, (3.0, 1.0), (0.9,))
