"""From the images of a stream to those of one pinhole camera: lenses undone, depth aligned to colour."""

from __future__ import annotations

import numpy as np

from hgs_core.geometry.lens import LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.depth_registration import DepthRegistration
from hgs_core.sensing.pixel_lookup import PixelLookup
from hgs_core.sensing.raw_frame import AlignedFrame, RawFrame

_SAME_PLACE_M = 1e-4
_SAME_TURN = 1e-5


class Rectifier:
    """Keeps the tables of the cameras it saw last: a stream's cameras seldom change.

    Colour is interpolated bilinearly. Depth is taken from the nearest pixel's ray where both cameras stand at
    the same place and look the same way (within 0.1 mm and 1e-5 rad); else it is reprojected into the colour
    camera, so that its edges lie where the colour camera sees them. The pinhole camera keeps the colour
    image's size; its focal lengths are enlarged where the lens leaves corners without an image
    (`LensCamera.undistorted`).
    """

    def __init__(self) -> None:
        self._cameras: _Cameras | None = None

    def rectify(self, raw: RawFrame) -> AlignedFrame:
        """Raises `ConfigError` for a lens that cannot be undone."""
        cameras = self._cameras
        if cameras is None or not cameras.are_those_of(raw):
            cameras = self._cameras = _Cameras(raw)
        depth_m = cameras.depth.nearest(raw.depth_m)
        if cameras.registration is not None:
            depth_m = cameras.registration.register(depth_m)
        return AlignedFrame(
            rgb=cameras.colour.bilinear(raw.rgb),
            depth_m=depth_m,
            intrinsics=cameras.intrinsics,
            T_world_camera=raw.T_world_camera,
            timestamp_s=raw.timestamp_s,
            sequence=raw.sequence,
            robot_id=raw.robot_id,
        )


class _Cameras:
    """The tables for one pair of cameras."""

    def __init__(self, raw: RawFrame) -> None:
        self._colour_camera: LensCamera = raw.colour_camera
        self._depth_camera: LensCamera = raw.depth_camera
        self._T_colour_depth: SE3 = raw.T_colour_depth
        self.intrinsics = raw.colour_camera.undistorted()
        self.colour = PixelLookup(self.intrinsics, raw.colour_camera)
        self.registration: DepthRegistration | None = None
        if _is_identity(raw.T_colour_depth):
            self.depth = PixelLookup(self.intrinsics, raw.depth_camera)
        else:
            pinhole = raw.depth_camera.undistorted()
            self.depth = PixelLookup(pinhole, raw.depth_camera)
            self.registration = DepthRegistration(
                colour=self.intrinsics, depth=pinhole, T_colour_depth=raw.T_colour_depth
            )

    def are_those_of(self, raw: RawFrame) -> bool:
        return (
            self._colour_camera == raw.colour_camera
            and self._depth_camera == raw.depth_camera
            and np.array_equal(self._T_colour_depth.as_matrix(), raw.T_colour_depth.as_matrix())
        )


def _is_identity(T: SE3) -> bool:
    turned = float(np.abs(T.rotation - np.eye(3)).max())
    return turned <= _SAME_TURN and float(np.linalg.norm(T.translation)) <= _SAME_PLACE_M
