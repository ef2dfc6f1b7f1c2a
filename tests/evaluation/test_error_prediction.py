"""A map that is wrong where it was seen least: the posterior variance tells where, depth does not."""

import numpy as np

from hgs_core.evaluation.error_prediction import ErrorPredictors
from hgs_core.gaussians.gaussian_map import RGB, GaussianMap
from hgs_core.gaussians.posterior_image import PRIOR_INFORMATION, train_information
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3

CAMERA = CameraIntrinsics.centred(160, 120, 80.0)


def wall() -> GaussianMap:
    """Grey Gaussians every 4 cm on the plane x = 2 m, 4 m wide and 3 m high."""
    y, z = np.meshgrid(np.arange(-2.0, 2.0, 0.04), np.arange(-0.5, 2.5, 0.04))
    parameters = np.zeros((y.size, 8), np.float32)
    parameters[:, 0], parameters[:, 1], parameters[:, 2] = 2.0, y.ravel(), z.ravel()
    parameters[:, RGB], parameters[:, 6], parameters[:, 7] = 0.5, np.log(0.03), 3.0
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    return gaussians


def frames() -> SE3:
    """Many looks to the left, some straight ahead, one to the right."""
    yaws = [0.5] * 16 + [0.0] * 4 + [-0.5]
    poses = [level_camera_pose(0.0, 0.0, 1.0, yaw) for yaw in yaws]
    return SE3(
        rotation=np.stack([pose.rotation for pose in poses]),
        translation=np.stack([pose.translation for pose in poses]),
    )


def test_errors_of_the_variance_that_the_frames_left_are_predicted_and_depth_is_beaten() -> None:
    gaussians, poses, pose = wall(), frames(), level_camera_pose(0.0, 0.0, 1.0, 0.0)
    truth = render(gaussians, CAMERA, pose).colour
    predictors = ErrorPredictors.of(gaussians, CAMERA, poses, range_m=5.0)

    half = CameraIntrinsics(width=80, height=60, fx=40.0, fy=40.0, cx=40.0, cy=30.0, low_pass_px2=1 / 48)
    information = train_information(gaussians, half, poses, far_m=6.0)
    deviation = 0.03 / np.sqrt(information[:, RGB] + PRIOR_INFORMATION)
    noise = np.random.default_rng(0).normal(size=deviation.shape)
    gaussians.parameters[: gaussians.size, RGB] += (deviation * noise).astype(np.float32)
    view = render(gaussians, CAMERA, pose)

    error = np.abs(view.colour - truth).mean(axis=2)
    everything = view.silhouette > 0.5
    score = predictors.score(error, view.depth_m, everything, CAMERA, pose)
    assert score.quality.correlation > 0.5
    assert score.quality.correlation > abs(score.depth.correlation) + 0.3
    assert score.constant.correlation == 0.0
    assert score.quality.sparsification_error < 0.6 * score.depth.sparsification_error
    assert score.quality.sparsification_error < 0.6 * score.constant.sparsification_error


def test_the_map_is_left_as_it_was() -> None:
    gaussians = wall()
    before, version = gaussians.parameters.copy(), gaussians.version
    ErrorPredictors.of(gaussians, CAMERA, frames(), range_m=5.0)
    np.testing.assert_array_equal(gaussians.parameters, before)
    assert not gaussians.information.any()
    assert gaussians.version == version
