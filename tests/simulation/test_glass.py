"""Glass returns no depth, at the same places from everywhere; all else is the plain camera."""

import numpy as np
import pytest

from hgs_core.errors import ConfigError
from hgs_core.mission.config import resolve_mission_config
from hgs_core.robot.differential import DifferentialConfig
from hgs_core.scene.free_floor import StartPose
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import Scene
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.sensing.frame import Frame
from hgs_core.sensing.scanner import ScannerConfig
from hgs_core.simulation.glass_camera import GlassCameraConfig, is_glass
from hgs_core.simulation.registry import sensor_methods
from hgs_core.simulation.world import SimulatedWorld
from tests.scene.worlds import room

PLAIN = DepthCameraConfig(width=60, height=34, focal_px=30.0)
GLASS = GlassCameraConfig(width=60, height=34, focal_px=30.0, glass_share=0.3)


def frame(config: DepthCameraConfig, *, seed: int = 0, x_m: float = -1.0, yaw_rad: float = 0.3) -> Frame:
    mesh = room()
    scene = Scene(
        name="room",
        mesh=mesh,
        caster=RayCaster(mesh),
        bounds=mesh.bounds(),
        start=StartPose(x_m=x_m, y_m=0.0, yaw_rad=yaw_rad),
        notices=(),
    )
    world = SimulatedWorld.of(
        scene,
        robot=DifferentialConfig(),
        camera=config,
        scanner=ScannerConfig(),
        seeds=np.random.SeedSequence(seed),
    )
    return world.camera.capture()


def surface(taken: Frame, depth_m: np.ndarray) -> np.ndarray:
    return taken.T_world_camera.apply(taken.intrinsics.rays() * depth_m[..., None].astype(float))


def test_only_glass_is_missing_and_all_else_is_the_plain_cameras() -> None:
    plain, glass = frame(PLAIN), frame(GLASS)
    holes = glass.depth_m == 0
    np.testing.assert_array_equal(glass.rgb, plain.rgb)
    np.testing.assert_array_equal(glass.depth_m[~holes], plain.depth_m[~holes])
    assert 0.05 < holes.mean() < 0.6
    clean = frame(PLAIN.model_copy(update={"depth_noise_m": 0.0}))
    points = surface(clean, clean.depth_m)
    np.testing.assert_array_equal(holes, is_glass(points.reshape(-1, 3), GLASS).reshape(holes.shape))


def test_the_holes_stay_where_they_are_from_another_place_and_in_another_mission() -> None:
    """What one frame misses, another from elsewhere misses too, whatever the mission's seed."""
    quiet = GLASS.model_copy(update={"depth_noise_m": 0.0})
    other = frame(quiet, seed=5, x_m=-2.0, yaw_rad=0.0)
    depth = frame(PLAIN.model_copy(update={"depth_noise_m": 0.0}), x_m=-2.0, yaw_rad=0.0).depth_m
    expected = is_glass(surface(other, depth).reshape(-1, 3), quiet).reshape(depth.shape)
    np.testing.assert_array_equal(other.depth_m == 0, expected)
    np.testing.assert_array_equal(frame(GLASS).depth_m, frame(GLASS).depth_m)


@pytest.mark.parametrize("share", [0.0, 0.05, 0.5, 1.0])
def test_the_share_is_that_of_the_surface(share: float) -> None:
    config = GlassCameraConfig(glass_share=share, glass_size_m=0.1)
    wall = np.random.default_rng(0).uniform([0.0, 2.0, 0.2], [40.0, 2.0, 3.0], (100_000, 3))
    assert is_glass(wall, config).mean() == pytest.approx(share, abs=0.015)
    assert not is_glass(wall * [1.0, 1.0, 0.0], config).any()  # the floor


def test_another_seed_is_another_glass() -> None:
    wall = np.random.default_rng(0).uniform([-20.0, 2.0, 0.2], [20.0, 2.0, 3.0], (5000, 3))
    first, second = (is_glass(wall, GLASS.model_copy(update={"glass_seed": seed})) for seed in (0, 1))
    assert (first != second).mean() > 0.2


def test_nothing_in_range_stays_nothing_in_range() -> None:
    near = {"range_m": 1.5}
    plain = frame(PLAIN.model_copy(update=near))
    glass = frame(GLASS.model_copy(update=near))
    assert np.isinf(plain.depth_m).any()
    np.testing.assert_array_equal(np.isinf(glass.depth_m), np.isinf(plain.depth_m))


def test_a_mission_asks_for_its_sensor_by_name() -> None:
    config = resolve_mission_config(
        "quick", {"sensor.camera.method": "glass", "sensor.camera.glass_share": "0.2"}
    )
    camera = config.sensor.camera
    assert isinstance(camera, GlassCameraConfig)
    assert (camera.width, camera.glass_share) == (600, 0.2)
    assert config.model_dump(mode="json")["sensor"]["camera"]["glass_share"] == 0.2
    assert isinstance(
        resolve_mission_config("robust", {"sensor": "rgbd_5m_tiny_glass"}).sensor.camera, GlassCameraConfig
    )


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("method", "sonar", r"no sensor 'sonar'; there are: glass, rgbd"),
        ("method", "3", r"must be one of glass, rgbd"),
        ("glass_share", "0.1", r"sensor\.camera\.glass_share"),
    ],
)
def test_a_wrong_sensor_setting_is_named(key: str, value: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        resolve_mission_config("quick", {f"sensor.camera.{key}": value})
    assert sensor_methods() == ["glass", "rgbd"]
