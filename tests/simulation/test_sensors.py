from dataclasses import replace

import numpy as np
import pytest

from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.path import Path
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.world import SimulatedWorld
from tests.scene.worlds import with_boxes

CAMERA = DepthCameraConfig(width=60, height=34, focal_px=30.0)
SCANNER = ScannerConfig(n_rays=360)


@pytest.fixture(scope="module")
def scene():
    mesh = with_boxes(((1.0, -0.5, 0.0), (1.5, 0.5, 0.5)))
    return Scene(
        name="test",
        mesh=mesh,
        caster=RayCaster(mesh),
        bounds=mesh.bounds(),
        start=StartPose(x_m=-1.0, y_m=0.0, yaw_rad=0.0),
        notices=(),
    )


def world(scene, *, seed=0, camera=CAMERA, scanner=SCANNER):
    return SimulatedWorld.of(
        scene, robot=DifferentialConfig(), camera=camera, scanner=scanner, seeds=np.random.SeedSequence(seed)
    )


def test_a_frame_is_taken_from_the_mast_of_the_robot(scene):
    frame = world(scene, camera=CAMERA.model_copy(update={"depth_noise_m": 0.0})).camera.capture()
    np.testing.assert_allclose(frame.T_world_camera.translation, [-1.0, 0.0, 1.0])
    # Looking along +x at the wall x = 3, 4 m ahead; the image's middle row passes over the block.
    np.testing.assert_allclose(frame.depth_m[16, 25:35], 4.0, atol=1e-4)
    assert frame.intrinsics == CAMERA.intrinsics()
    assert (frame.sequence, frame.timestamp_s) == (0, 0.0)


def test_depth_noise_is_uniform_within_its_bounds_and_leaves_no_return_alone(scene):
    config = DepthCameraConfig(width=240, height=136, focal_px=120.0, range_m=3.5)
    clean = world(scene, camera=config.model_copy(update={"depth_noise_m": 0.0})).camera.capture().depth_m
    noisy = world(scene, camera=config).camera.capture().depth_m
    np.testing.assert_array_equal(np.isinf(noisy), np.isinf(clean))
    measured = np.isfinite(clean)
    error = noisy[measured] - clean[measured]
    assert np.isinf(clean).any()
    assert np.abs(error).max() <= 0.02 + 1e-6
    assert error.std() == pytest.approx(0.02 / np.sqrt(3), rel=0.03)
    assert abs(error.mean()) < 5e-4


def test_colour_is_the_same_in_every_frame_and_noise_is_not(scene):
    camera = world(scene).camera
    first, second = camera.capture(), camera.capture()
    np.testing.assert_array_equal(first.rgb, second.rgb)
    assert not np.array_equal(first.depth_m, second.depth_m)
    assert second.sequence == 1


def test_the_same_seed_gives_the_same_frames_and_scans(scene):
    first, second, other = world(scene), world(scene), world(scene, seed=1)
    for _ in range(2):
        a, b = first.camera.capture(), second.camera.capture()
        np.testing.assert_array_equal(a.depth_m, b.depth_m)
        np.testing.assert_array_equal(first.scanner.scan().ranges_m, second.scanner.scan().ranges_m)
    assert not np.array_equal(a.depth_m, other.camera.capture().depth_m)


def test_a_scan_measures_the_room_around_the_robot(scene):
    quiet = SCANNER.model_copy(update={"noise_m": 0.0, "range_m": 3.0})
    scan = world(scene, scanner=quiet).scanner.scan()
    np.testing.assert_allclose(scan.origin_m, [-1.0, 0.0, 0.15])
    hit = scan.origin_m[:2] + scan.ranges_m[:, None] * np.stack(
        [np.cos(scan.bearings_rad), np.sin(scan.bearings_rad)], axis=-1
    )
    by_degree = {round(np.degrees(b)): k for k, b in enumerate(scan.bearings_rad)}
    assert hit[by_degree[0], 0] == pytest.approx(1.0, abs=1e-4)  # the block, not the wall behind it
    assert hit[by_degree[90], 1] == pytest.approx(2.0, abs=1e-4)
    assert hit[by_degree[180], 0] == pytest.approx(-3.0, abs=1e-4)
    assert np.isinf(scan.ranges_m[by_degree[30]])  # the wall is 4 m away there


def test_bearings_turn_with_the_robot_in_the_world_frame(scene):
    turned = world(replace(scene, start=StartPose(x_m=-1.0, y_m=0.0, yaw_rad=np.pi / 2)))
    assert turned.scanner.scan().bearings_rad[0] == pytest.approx(np.pi / 2)


def test_a_restored_world_goes_on_as_the_first_would_have(scene):
    first = world(scene)
    first.robot.follow(
        Path(positions_m=np.array([[-1.0, 0.0], [-1.0, 1.0]]), yaws_rad=np.array([np.nan, 0.5]))
    )
    first.robot.advance(0.7)
    first.camera.capture()
    first.scanner.scan()
    second = world(scene, seed=9)
    second.restore(first.state())
    for _ in range(3):
        assert first.robot.advance(0.4) == second.robot.advance(0.4)
        a, b = first.camera.capture(), second.camera.capture()
        np.testing.assert_array_equal(a.depth_m, b.depth_m)
        np.testing.assert_array_equal(a.rgb, b.rgb)
        assert a.sequence == b.sequence
        np.testing.assert_array_equal(first.scanner.scan().ranges_m, second.scanner.scan().ranges_m)
