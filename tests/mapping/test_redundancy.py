"""A frame is spared its learning only where the map foretells it."""

from dataclasses import replace

import numpy as np
import pytest

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.mapping.config import InsertionConfig, ThinningConfig
from hgs_core.mapping.insertion import new_gaussians
from hgs_core.mapping.keyframes import TrainingImage
from hgs_core.mapping.redundancy import every_second_pixel, foretold_psnr, is_near, moved_and_turned

CAMERA = CameraIntrinsics.centred(121, 80, 60.0)
THINNING = ThinningConfig()
INSERTION = InsertionConfig()


def grey_wall() -> TrainingImage:
    return TrainingImage(
        rgb=np.full((80, 121, 3), 120, np.uint8),
        depth_m=np.full((80, 121), 2.0, np.float32),
        intrinsics=CAMERA,
        T_world_camera=level_camera_pose(0.0, 0.0, 1.0, 0.3),
    )


def map_of(image: TrainingImage) -> GaussianMap:
    gaussians = GaussianMap()
    spacing = np.full(image.depth_m.shape, 0.04, np.float32)
    new = new_gaussians(image, image.measured, spacing, INSERTION)
    gaussians.append(new.parameters, anchor_keyframe=0)
    return gaussians


def test_motion_between_poses() -> None:
    before = level_camera_pose(0.0, 0.0, 1.0, 0.0)
    after = level_camera_pose(0.3, 0.4, 1.0, np.radians(25.0))
    moved_m, turned_deg = moved_and_turned(after, before)
    assert moved_m == pytest.approx(0.5)
    assert turned_deg == pytest.approx(25.0)


def test_near_is_near_in_place_and_in_direction() -> None:
    learnt = level_camera_pose(1.0, 0.0, 1.0, 0.0)
    assert not is_near(learnt, None, THINNING)
    assert is_near(level_camera_pose(1.04, 0.0, 1.0, np.radians(2.5)), learnt, THINNING)
    assert not is_near(level_camera_pose(1.06, 0.0, 1.0, 0.0), learnt, THINNING)
    assert not is_near(level_camera_pose(1.0, 0.0, 1.0, np.radians(-3.5)), learnt, THINNING)


def test_every_second_pixel_looks_along_the_same_rays() -> None:
    few = every_second_pixel(grey_wall())
    np.testing.assert_allclose(few.intrinsics.rays(), CAMERA.rays()[::2, ::2], atol=1e-12)
    assert few.rgb.shape == (40, 61, 3)


def test_what_the_map_shows_already_is_foretold() -> None:
    image = grey_wall()
    psnr_db = foretold_psnr(map_of(image), image, INSERTION, THINNING)
    assert psnr_db is not None
    assert psnr_db > 30.0


def test_nothing_is_foretold_by_an_empty_map_or_without_depth() -> None:
    image = grey_wall()
    assert foretold_psnr(GaussianMap(), image, INSERTION, THINNING) is None
    blind = replace(image, depth_m=np.zeros_like(image.depth_m))
    assert foretold_psnr(map_of(image), blind, INSERTION, THINNING) is None


def test_other_colours_are_news() -> None:
    image = grey_wall()
    repainted = replace(image, rgb=np.full_like(image.rgb, 160))
    assert foretold_psnr(map_of(image), repainted, INSERTION, THINNING) is None


@pytest.mark.parametrize(("side_px", "is_news"), [(4, False), (24, True)])
def test_something_in_front_of_the_map_is_news_when_it_is_large_enough(side_px: int, is_news: bool) -> None:
    """16 of 9680 pixels are less than the hundredth that may be missing, 576 are more."""
    image = grey_wall()
    depth_m = image.depth_m.copy()
    depth_m[20 : 20 + side_px, 40 : 40 + side_px] = 1.5
    foretold = foretold_psnr(map_of(image), replace(image, depth_m=depth_m), INSERTION, THINNING)
    assert (foretold is None) == is_news
