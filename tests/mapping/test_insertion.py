"""New Gaussians: where, how far apart, how large."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from hgs_core.gaussians.gaussian_map import CENTRE, LOG_RADIUS, RGB
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import InsertionConfig
from hgs_core.mapping.insertion import new_gaussians, wanted_spacing
from hgs_core.mapping.keyframes import TrainingImage

CAMERA = CameraIntrinsics.centred(600, 340, 300.0)
CONFIG = InsertionConfig()
ALL = np.ones((340, 600), bool)


def picture(depth_m: np.ndarray, rgb: np.ndarray | None = None) -> TrainingImage:
    return TrainingImage(
        rgb=np.full((340, 600, 3), 128, np.uint8) if rgb is None else rgb,
        depth_m=depth_m.astype(np.float32),
        intrinsics=CAMERA,
        T_world_camera=level_camera_pose(1.0, 2.0, 1.0, 0.7),
    )


def wall_at(z_m: float, rgb: np.ndarray | None = None) -> TrainingImage:
    return picture(np.full((340, 600), z_m), rgb)


def chequered(difference: int) -> np.ndarray:
    bright = (np.add.outer(np.arange(340), np.arange(600)) % 2 == 0)[..., None]
    return np.where(bright, 100 + difference, 100).astype(np.uint8).repeat(3, axis=2)


def in_camera(image: TrainingImage, parameters: np.ndarray) -> np.ndarray:
    return image.T_world_camera.inverse().apply(parameters[:, CENTRE].astype(float))


def test_spacing_is_wider_where_there_is_less_to_see() -> None:
    """Finest where the contrast is large; its inverse square root where it is less; then the widest."""
    finest = 0.5 * CONFIG.finest_px * 3.0 / CAMERA.fx
    assert finest > CONFIG.finest_m
    for difference in (0, 5, 20, 40, 100):
        spacing = wanted_spacing(wall_at(3.0, chequered(difference)), CONFIG)
        contrast = max(difference / 255.0, 1e-3)
        factor = np.clip(np.sqrt(CONFIG.detail_contrast / contrast), 1.0, CONFIG.widest_factor)
        np.testing.assert_allclose(spacing, finest * factor, rtol=1e-5)


@pytest.mark.parametrize(
    ("z_m", "focal_px", "spacing_m"),
    [(3.0, 300.0, 0.04), (5.0, 300.0, 0.04), (5.0, 150.0, 0.04), (5.0, 75.0, 5.0 / 75.0)],
)
def test_a_plain_wall_is_no_wider_than_completeness_needs(z_m, focal_px, spacing_m) -> None:
    """Whatever the camera's pixels and the distance; of few pixels each counts."""
    image = replace(wall_at(z_m), intrinsics=CameraIntrinsics.centred(600, 340, focal_px))
    np.testing.assert_allclose(wanted_spacing(image, CONFIG), spacing_m, rtol=1e-5)


def test_spacing_has_a_least_value_and_is_zero_without_a_measurement() -> None:
    image = wall_at(0.5, chequered(255 - 100))
    np.testing.assert_allclose(wanted_spacing(image, CONFIG), CONFIG.finest_m, rtol=1e-6)
    holes = picture(np.where(np.arange(600) % 3 == 0, 0.0, np.inf) + np.zeros((340, 1)))
    assert not wanted_spacing(holes, CONFIG).any()


@pytest.mark.parametrize(("z_m", "stride_px"), [(4.0, 4), (2.0, 4), (1.0, 8), (0.5, 16)])
def test_a_facing_wall_gets_a_square_lattice(z_m: float, stride_px: int) -> None:
    image = wall_at(z_m)
    parameters = new_gaussians(image, ALL, wanted_spacing(image, CONFIG), CONFIG).parameters
    assert len(parameters) == pytest.approx(340 * 600 / stride_px**2, rel=0.05)
    spacing = stride_px * z_m / CAMERA.fx
    np.testing.assert_allclose(np.exp(parameters[:, LOG_RADIUS]), CONFIG.radius_factor * spacing, rtol=1e-4)
    points = in_camera(image, parameters)
    np.testing.assert_allclose(points[:, 2], z_m, rtol=1e-5)
    pixels, inside = CAMERA.project(points)
    assert inside.all()
    np.testing.assert_allclose(pixels % 1.0, 0.5, atol=1e-2)  # pixel centres
    np.testing.assert_allclose(parameters[:, RGB], 128 / 255, rtol=1e-6)


def test_a_slanted_floor_is_covered_evenly() -> None:
    """Rows of pixels on the floor are several times farther apart than columns; the Gaussians are not."""
    slope = np.clip((np.arange(340) + 0.5 - CAMERA.cy) / CAMERA.fy, 0.2, None)
    image = picture(np.repeat((1.0 / slope)[:, None], 600, axis=1))
    wanted = np.zeros((340, 600), bool)
    wanted[240:] = True  # nearer than 4.2 m
    spacing = np.full((340, 600), 0.05, np.float32)
    parameters = new_gaussians(image, wanted, spacing, CONFIG).parameters
    points = in_camera(image, parameters)[:, [0, 2]]
    inner = points[(np.abs(points[:, 0]) < 1.0) & (points[:, 1] > 1.9) & (points[:, 1] < 3.8)]
    assert len(inner) == pytest.approx(2.0 * 1.9 / 0.05**2, rel=0.35)
    radius = np.exp(parameters[:, LOG_RADIUS]) / CONFIG.radius_factor
    assert np.all((radius > 0.03) & (radius < 0.085))


def test_a_surface_seen_at_a_grazing_angle_has_no_gaps() -> None:
    """A table's top a hand below the camera: rows of pixels are up to 20 cm apart on it."""
    row = np.arange(340)[:, None] + 0.5
    drop = np.maximum((row - CAMERA.cy) / CAMERA.fy, 1e-3)
    depth = np.where((0.15 / drop < 4.0) & (0.15 / drop > 1.0), 0.15 / drop, 0.0) + np.zeros((1, 600))
    image = picture(depth)
    spacing = np.where(image.measured, 0.04, 0.0).astype(np.float32)
    sparse = new_gaussians(
        image, image.measured, spacing, CONFIG.model_copy(update={"grazing_pitch": 1.0})
    ).parameters
    dense = new_gaussians(image, image.measured, spacing, CONFIG).parameters
    x = np.linspace(-0.5, 0.5, 60)
    z = np.linspace(1.05, 3.6, 300)
    top = np.stack(np.broadcast_arrays(x[:, None], 0.15, z), axis=-1).reshape(-1, 3)
    gap_m = {
        name: float(cKDTree(in_camera(image, parameters)).query(top)[0].max())
        for name, parameters in (("sparse", sparse), ("dense", dense))
    }
    assert gap_m["sparse"] > 0.07
    assert gap_m["dense"] < 0.05
    np.testing.assert_allclose(in_camera(image, dense)[:, 1], 0.15, atol=2e-3)
    assert np.median(dense[:, LOG_RADIUS]) < np.median(sparse[:, LOG_RADIUS])


def test_a_leg_of_one_pixel_is_not_smeared_along_the_ray() -> None:
    depth = np.full((340, 600), 4.0)
    depth[:, 100] = 3.85
    image = picture(depth)
    near_m = np.full((340, 600), 0.008, np.float32)
    points = in_camera(image, new_gaussians(image, ALL, near_m, CONFIG).parameters)
    assert set(np.unique(points[:, 2].round(3)).tolist()) == {3.85, 4.0}


def test_wider_spacing_uses_a_part_of_the_same_lattice() -> None:
    image = wall_at(3.0)
    fine = new_gaussians(image, ALL, np.full((340, 600), 0.02, np.float32), CONFIG).parameters
    coarse = new_gaussians(image, ALL, np.full((340, 600), 0.04, np.float32), CONFIG).parameters
    assert len(fine) == 4 * len(coarse)
    assert {tuple(p) for p in coarse[:, CENTRE].tolist()} < {tuple(p) for p in fine[:, CENTRE].tolist()}


def test_only_wanted_pixels() -> None:
    image = wall_at(3.0)
    spacing = wanted_spacing(image, CONFIG)
    wanted = np.zeros((340, 600), bool)
    assert len(new_gaussians(image, wanted, spacing, CONFIG)) == 0
    wanted[:, :300] = True
    parameters = new_gaussians(image, wanted, spacing, CONFIG).parameters
    assert (in_camera(image, parameters)[:, 0] < 0.02).all()
    assert len(parameters) == pytest.approx(340 * 300 / 16, rel=0.05)


def test_without_slant_every_pixel_counts_as_facing_the_camera() -> None:
    """One Gaussian a pixel, z / f large: as SplaTAM places them, on a floor seen at a grazing angle, too."""
    rows = np.arange(340)[:, None] + 0.5
    floor = np.where(rows > 190, 300.0 / np.maximum(rows - 170, 1), 0.0) + np.zeros((1, 600))
    config = InsertionConfig(
        finest_px=2.0, finest_m=1e-6, widest_factor=1.0, radius_factor=1.0, follow_slant=False
    )
    image = picture(floor)
    parameters = new_gaussians(image, image.measured, wanted_spacing(image, config), config).parameters
    assert len(parameters) == np.count_nonzero(image.measured)
    z = in_camera(image, parameters)[:, 2]
    np.testing.assert_allclose(np.exp(parameters[:, LOG_RADIUS]), z / CAMERA.fx, rtol=1e-4)


def test_discs_lie_in_the_slanted_surface() -> None:
    normal = np.array([0.6, 0.2, 1.0])
    image = picture(1.5 / np.maximum(CAMERA.rays() @ normal, 0.2))
    new = new_gaussians(image, image.depth_m < 4.0, wanted_spacing(image, CONFIG), CONFIG, "disc")
    balls = new_gaussians(image, image.depth_m < 4.0, wanted_spacing(image, CONFIG), CONFIG)
    np.testing.assert_array_equal(new.parameters, balls.parameters)
    assert balls.normals.shape == (len(balls), 0)
    world = image.T_world_camera.rotation @ (-normal / np.linalg.norm(normal))
    assert np.mean(new.normals @ world.astype(np.float32) > 0.999) > 0.97
    np.testing.assert_allclose(np.linalg.norm(new.normals, axis=1), 1.0, atol=1e-6)
