"""The cameras that a robot says it has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hgs_core.errors import ConfigError, StreamError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import Distortion, LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.live.messages import CameraFacts, DepthCameraFacts, Hello
from hgs_core.live.poses import pose_of


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotCameras:
    """The colour camera, and the depth camera where it is another one."""

    colour: LensCamera
    depth: LensCamera
    T_colour_depth: SE3

    @staticmethod
    def of(hello: Hello) -> RobotCameras:
        """Raises `StreamError` for cameras that cannot be."""
        colour = _camera(hello.camera, "camera")
        other = hello.depth_camera
        if other is None:
            identity = SE3(rotation=np.eye(3), translation=np.zeros(3))
            return RobotCameras(colour=colour, depth=colour, T_colour_depth=identity)
        return RobotCameras(
            colour=colour,
            depth=_camera(other, "depth_camera"),
            T_colour_depth=pose_of(other.pose, "depth_camera"),
        )


def _camera(facts: CameraFacts | DepthCameraFacts, what: str) -> LensCamera:
    try:
        camera = LensCamera(
            intrinsics=CameraIntrinsics(
                width=facts.width, height=facts.height, fx=facts.fx, fy=facts.fy, cx=facts.cx, cy=facts.cy
            ),
            distortion=Distortion.named(facts.lens.model, facts.lens.coefficients),
        )
        camera.undistorted()
    except ConfigError as error:
        raise StreamError(f"{what}: {error}") from error
    return camera
