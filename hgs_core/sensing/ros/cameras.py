"""`sensor_msgs/CameraInfo`."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hgs_core.errors import ConfigError, StreamError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import Distortion, LensCamera

CAMERA_INFO: Final = "sensor_msgs/msg/CameraInfo"

_PIXEL_CENTRE: Final = 0.5
"""ROS counts pixel coordinates from the centre of the first pixel, this project from its corner."""


def lens_camera(message: Any, where: str) -> LensCamera:
    """The camera of a CameraInfo's K, D and distortion model. Raises `StreamError` for one that is not
    calibrated (K all zero), binned or cropped, or whose lens is not known."""
    k = np.asarray(message.k, dtype=float)
    if k.shape != (9,) or not np.isfinite(k).all() or k[0] <= 0 or k[4] <= 0:
        raise StreamError(f"{where}: K = {k.tolist()} is no calibrated camera: record its calibration")
    if message.binning_x > 1 or message.binning_y > 1:
        raise StreamError(
            f"{where}: binning {message.binning_x} x {message.binning_y} is not read: record the image at "
            "full size, or a CameraInfo of its own for the binned one"
        )
    if message.roi.width or message.roi.height:
        raise StreamError(f"{where}: a region of interest is not read: record the whole image")
    try:
        intrinsics = CameraIntrinsics(
            width=int(message.width),
            height=int(message.height),
            fx=float(k[0]),
            fy=float(k[4]),
            cx=float(k[2]) + _PIXEL_CENTRE,
            cy=float(k[5]) + _PIXEL_CENTRE,
        )
        model = message.distortion_model if len(message.d) else "none"
        return LensCamera(intrinsics=intrinsics, distortion=Distortion.named(model, message.d))
    except ConfigError as error:
        raise StreamError(f"{where}: {error}") from error
