"""The variance that is left in the map's colours: hand-solved, and against the map's own information."""

import numpy as np
import pytest

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.information import accumulate_information
from hgs_core.gaussians.posterior_image import PRIOR_INFORMATION, PosteriorImages, train_information
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3

CAMERA = CameraIntrinsics.centred(80, 60, 60.0)


def two_spots() -> GaussianMap:
    """Two opaque spots 2 m ahead, left and right, and one 5 m ahead that is behind the first."""
    parameters = np.zeros((3, 8), np.float32)
    parameters[:, :3] = [(2.0, 0.5, 1.0), (2.0, -0.5, 1.0), (5.0, 1.25, 1.0)]
    parameters[:, 3:6] = [(0.9, 0.1, 0.2), (0.1, 0.8, 0.3), (0.5, 0.5, 0.5)]
    parameters[:, 6], parameters[:, 7] = np.log(0.1), 4.0
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    return gaussians


def batch(*poses: SE3) -> SE3:
    return SE3(
        rotation=np.stack([pose.rotation for pose in poses]),
        translation=np.stack([pose.translation for pose in poses]),
    )


def test_information_of_all_frames_is_what_the_mapper_would_have_summed() -> None:
    gaussians = two_spots()
    poses = [level_camera_pose(0.0, y, 1.0, 0.1 * y) for y in (-0.3, 0.0, 0.4)]
    summed = train_information(gaussians, CAMERA, batch(*poses), far_m=4.0)
    assert not gaussians.information.any()
    for pose in poses:
        accumulate_information(gaussians, CAMERA, pose, far_m=4.0)
    np.testing.assert_array_equal(summed, gaussians.information[:3])
    assert summed[0, 3] > 0
    assert summed[2, 3] == 0.0  # too far away


def test_of_very_many_frames_some_count_for_the_others() -> None:
    gaussians, here = two_spots(), level_camera_pose(0.0, 0.0, 1.0, 0.0)
    all_drawn = train_information(gaussians, CAMERA, batch(*[here] * 9), far_m=4.0)
    some_drawn = train_information(gaussians, CAMERA, batch(*[here] * 9), far_m=4.0, most_frames=4)
    np.testing.assert_allclose(some_drawn, all_drawn, rtol=1e-5)


def test_a_pixel_shows_the_variance_of_the_gaussian_that_it_shows() -> None:
    gaussians = two_spots()
    information = np.zeros((3, 8), np.float32)
    information[:, 3:6] = np.array([[3.0], [0.5], [7.0]])
    image = PosteriorImages(gaussians, information).render(CAMERA, level_camera_pose(0.0, 0.0, 1.0, 0.0))
    # 0.5 m to the left at 2 m is 15 pixels; the second spot lies as far to the right.
    assert image[30, 54] == pytest.approx(1.0 / (0.5 + PRIOR_INFORMATION), rel=1e-3)
    # The centre of the first hides the third but for what its opacity, below 0.99, lets through.
    first, third = 1.0 / (3.0 + PRIOR_INFORMATION), 1.0 / (7.0 + PRIOR_INFORMATION)
    assert third < image[30, 24] <= first
    assert image[30, 24] == pytest.approx(first, rel=0.03)
    assert image[0, 0] == 0.0


def test_every_further_look_leaves_less_variance() -> None:
    gaussians, here = two_spots(), level_camera_pose(0.0, 0.0, 1.0, 0.0)
    images = [
        PosteriorImages(
            gaussians, train_information(gaussians, CAMERA, batch(*[here] * n), far_m=9.0)
        ).render(CAMERA, here)
        for n in (1, 2, 4)
    ]
    seen = images[0] > 0
    assert seen.any()
    assert (images[1][seen] < images[0][seen]).all()
    assert (images[2][seen] < images[1][seen]).all()


def test_information_of_another_map_is_refused() -> None:
    with pytest.raises(MapError, match="rows of information"):
        PosteriorImages(two_spots(), np.zeros((2, 8), np.float32))
