"""Given poses: believed, unless they are impossible."""

import numpy as np
import pytest

from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.given import GivenConfig, GivenPoses
from hgs_core.localisation.localiser import Localiser, Located, Lost
from hgs_core.localisation.motion import MotionLimits
from hgs_core.sensing.raw_frame import AlignedFrame

CAMERA = CameraIntrinsics.centred(4, 3, 4.0)
LIMITS = MotionLimits(max_speed_mps=1.0, max_turn_rate_degps=90.0, slack_m=0.1, slack_deg=2.0)


def frame(pose: SE3 | None, time_s: float) -> AlignedFrame:
    return AlignedFrame(
        rgb=np.zeros((3, 4, 3), np.uint8),
        depth_m=np.ones((3, 4), np.float32),
        intrinsics=CAMERA,
        T_world_camera=pose,
        timestamp_s=time_s,
        sequence=7,
    )


def at(x_m: float, yaw_deg: float = 0.0) -> SE3:
    return level_camera_pose(x_m, 0.0, 1.0, np.radians(yaw_deg))


def begun() -> GivenPoses:
    localiser = GivenPoses(GivenConfig(limits=LIMITS))
    assert isinstance(localiser, Localiser)
    assert isinstance(localiser.locate(frame(at(0.0), 10.0)), Located)
    return localiser


def test_possible_poses_are_handed_on() -> None:
    localiser, pose = begun(), at(0.29, 19.9)
    answer = localiser.locate(frame(pose, 10.2))
    assert isinstance(answer, Located)
    assert answer.T_world_camera is pose


def bent(pose: SE3) -> SE3:
    return SE3(rotation=pose.rotation * 1.01, translation=pose.translation)


def mirrored(pose: SE3) -> SE3:
    return SE3(rotation=pose.rotation @ np.diag([1.0, 1.0, -1.0]), translation=pose.translation)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (None, "no pose"),
        (SE3(rotation=at(0.0).rotation, translation=np.array([np.nan, 0, 0])), "is not finite"),
        (bent(at(0.0)), "axes are off orthonormal by 0.0201"),
        (mirrored(at(0.0)), "it mirrors"),
        (at(0.31), "moved 0.31 m in 0.20 s, at most 0.30 m is possible"),
        (at(0.0, 20.5), "turned 20.5 degrees in 0.20 s, at most 20.0 is possible"),
    ],
)
def test_impossible_poses_are_refused_and_said_so(pose: SE3 | None, reason: str) -> None:
    localiser = begun()
    answer = localiser.locate(frame(pose, 10.2))
    assert isinstance(answer, Lost)
    assert reason in answer.reason
    # The next is judged by the last that was believed.
    assert isinstance(localiser.locate(frame(at(0.4), 10.4)), Located)


def test_frames_out_of_order_are_refused() -> None:
    localiser = begun()
    answer = localiser.locate(frame(at(0.0), 10.0))
    assert isinstance(answer, Lost)
    assert "is not after 10.000 s" in answer.reason


def test_a_robot_that_was_carried_is_believed_after_as_long_as_it_would_have_driven() -> None:
    localiser = begun()
    answers = [localiser.locate(frame(at(5.0), 10.0 + wait_s)) for wait_s in (0.2, 2.0, 4.8, 4.95)]
    assert [isinstance(answer, Located) for answer in answers] == [False, False, False, True]
