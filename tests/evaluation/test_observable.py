"""The observable ceiling against its rule solved by hand and against a naive oracle that tries every yaw."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.evaluation import ceiling as ceiling_module
from hgs_core.evaluation.ceiling import CeilingRequest, observable_ceiling
from hgs_core.evaluation.observable import in_view_at_some_yaw, observable_mask
from hgs_core.evaluation.reachable import reachable_positions
from hgs_core.evaluation.surface import sample_surface
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import open_scene

CAMERA = CameraIntrinsics.centred(1200, 680, 600.0)
"""Half a field of view: 45 degrees across, arctan(340 / 600) up and down."""


def in_view(point: tuple[float, float, float]) -> bool:
    position = np.array([0.0, 0.0, 1.0])
    return bool(in_view_at_some_yaw(np.array([point]), position, intrinsics=CAMERA, range_m=5.0)[0])


def test_the_rule_by_hand() -> None:
    # Level with the camera: up to 5 m straight on, up to 5 / cos 45 = 7.07 m at the image's edge.
    assert in_view((4.9, 0, 1))
    assert in_view((0, 7.0, 1))
    assert not in_view((0, 7.1, 1))
    # The floor, 1 m below: from 600 / 340 = 1.76 m on.
    assert not in_view((1.7, 0, 0))
    assert in_view((1.8, 0, 0))
    # Beyond 5 m the z-depth is 5 m at most, so heights stay within 5 * 340 / 600 = 2.83 m of the camera.
    assert in_view((-6.0, 0, 3.8))
    assert not in_view((-6.0, 0, 3.9))


@given(st.floats(0.05, 9), st.floats(-np.pi, np.pi), st.floats(-4, 4))
def test_the_rule_agrees_with_trying_every_yaw(distance: float, azimuth: float, height: float) -> None:
    point = np.array([[distance * np.cos(azimuth), distance * np.sin(azimuth), 1 + height]])
    # Yaws a little inside the image's edge: exactly on it, rounding decides.
    offsets = np.linspace(-np.pi / 4 + 1e-6, np.pi / 4 - 1e-6, 2001)
    z = distance * np.cos(offsets)
    sharp = np.any((z <= 5.0) & (np.abs(height) <= z * 340 / 600))
    generous = np.any((z <= 5.0 + 2e-3) & (np.abs(height) <= z * 340 / 600 + 2e-3))
    answer = in_view((point[0, 0], point[0, 1], point[0, 2]))
    assert sharp <= answer <= generous
    if answer:  # the camera model itself agrees at the best yaw
        best = np.arccos(np.clip(min(distance, 5.0) / distance, np.cos(np.pi / 4), 1.0)) * (1 - 1e-9)
        pose = level_camera_pose(0, 0, 1, azimuth - best)
        pixel = CAMERA.project(pose.inverse().apply(point))[0][0]
        assert -0.01 <= pixel[0] <= 1200.01
        assert -2 <= pixel[1] <= 682


def observe(caster: RayCaster, samples: np.ndarray, positions: np.ndarray) -> np.ndarray:
    return observable_mask(
        caster,
        samples,
        positions_m=positions,
        camera_height_m=1.0,
        intrinsics=CAMERA,
        range_m=5.0,
    )


def in_view_of_any(samples: np.ndarray, positions: np.ndarray) -> np.ndarray:
    return np.any(
        [
            in_view_at_some_yaw(samples, np.array([*xy, 1.0]), intrinsics=CAMERA, range_m=5.0)
            for xy in positions
        ],
        axis=0,
    )


def test_in_an_empty_room_everything_in_view_is_observable(empty_room: RayCaster) -> None:
    """All but the middle of the ceiling: 1.5 m above the camera, seen from 1.5 * 600 / 340 = 2.65 m on."""
    samples = sample_surface(empty_room.mesh.vertices_m, empty_room.mesh.triangles, n_samples=3000)
    positions = reachable_positions(empty_room, start_xy=(2.0, 1.5), radius_m=0.25, height_m=1.1)
    seen = observe(empty_room, samples, positions)
    np.testing.assert_array_equal(seen, in_view_of_any(samples, positions))
    assert seen[samples[:, 2] < 1.8].all()
    middle = (samples[:, 2] > 2.49) & (np.hypot(samples[:, 0] - 2, samples[:, 1] - 1.5) < 0.8)
    assert not seen[middle].any()


def test_what_stands_behind_a_wall_is_not_observable(divided_room: RayCaster) -> None:
    samples = sample_surface(divided_room.mesh.vertices_m, divided_room.mesh.triangles, n_samples=3000)
    positions = reachable_positions(divided_room, start_xy=(1.0, 1.0), radius_m=0.25, height_m=1.1)
    seen = observe(divided_room, samples, positions)
    behind, before = samples[:, 0] > 2.91, samples[:, 0] < 2.89
    assert not seen[behind].any()
    np.testing.assert_array_equal(seen[before], in_view_of_any(samples, positions)[before])


def test_the_mask_equals_a_naive_loop_over_points(cast_boxes: Callable[..., RayCaster]) -> None:
    room = cast_boxes([((0, 0, 0), (4, 3, 2.5)), ((1.5, 1.0, 0.0), (2.5, 2.0, 1.2))])
    samples = sample_surface(room.mesh.vertices_m, room.mesh.triangles, n_samples=400)
    positions = np.array([[0.5, 0.5], [3.5, 0.5], [0.75, 2.5]])
    naive = [
        any(
            in_view_at_some_yaw(point[None], np.array([*xy, 1.0]), intrinsics=CAMERA, range_m=5.0)[0]
            and room.visible(np.array([*xy, 1.0]), point[None])[0]
            for xy in positions
        )
        for point in samples
    ]
    seen = observe(room, samples, positions)
    assert 0.2 < seen.mean() < 0.95
    assert np.mean(seen == naive) > 0.995  # single precision may differ for points on a silhouette


REQUEST = CeilingRequest(
    start_xy=(1.0, 1.0),
    robot_radius_m=0.25,
    robot_height_m=1.1,
    camera_height_m=1.0,
    intrinsics=CAMERA,
    range_m=5.0,
    n_samples=2001,
)


def test_the_ceiling_is_computed_once(
    divided_room: RayCaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path / "cache"))
    first = observable_ceiling(divided_room, REQUEST)
    assert 0.3 < first.fraction < 0.6

    def forbidden(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(ceiling_module, "observable_mask", forbidden)
    again = observable_ceiling(divided_room, REQUEST)
    np.testing.assert_array_equal(again.observable, first.observable)
    np.testing.assert_array_equal(again.positions_m, first.positions_m)
    np.testing.assert_array_equal(again.samples_m, first.samples_m)


def test_other_parameters_and_other_meshes_are_other_ceilings(
    divided_room: RayCaster, empty_room: RayCaster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path))
    observable_ceiling(divided_room, REQUEST)
    observable_ceiling(empty_room, REQUEST)
    observable_ceiling(divided_room, CeilingRequest(**{**vars(REQUEST), "start_xy": (5.0, 1.0)}))
    assert len(list(tmp_path.iterdir())) == 3


def test_a_damaged_cache_is_computed_again_and_said_so(
    divided_room: RayCaster,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path))
    first = observable_ceiling(divided_room, REQUEST)
    (cached,) = tmp_path.iterdir()
    cached.write_bytes(cached.read_bytes()[:100])
    again = observable_ceiling(divided_room, REQUEST)
    np.testing.assert_array_equal(again.observable, first.observable)
    assert "computing it again" in caplog.text


def test_a_cache_that_cannot_be_written_costs_only_time(
    divided_room: RayCaster,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path / "file"))
    assert observable_ceiling(divided_room, REQUEST).fraction > 0
    assert "cannot" in caplog.text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "published"), [("aws_small_house", 0.61), ("aws_bookstore", 0.46), ("pal_home", 0.76)]
)
def test_known_ceilings(
    shared_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, published: float
) -> None:

    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path))
    scene = open_scene(shared_dir / "scenes" / f"{name}.glb")
    request = CeilingRequest(
        **{**vars(REQUEST), "start_xy": (scene.start.x_m, scene.start.y_m), "n_samples": 100_000}
    )
    assert observable_ceiling(scene.caster, request).fraction == pytest.approx(published, abs=0.01)
