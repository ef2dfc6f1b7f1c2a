"""What a robot tells of itself: its cameras, and where it is."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from hgs_core.geometry.lens import LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.live.messages import CameraFacts, DepthCameraFacts, LensFacts, Report
from hgs_core.live.poses import numbers_of
from hgs_core.simulation.driven_robot import Moment


def camera_facts(
    camera: LensCamera, *, range_m: float, frame_interval_s: float, mount_height_m: float = 1.0
) -> CameraFacts:
    return CameraFacts(
        **_pinhole(camera),
        lens=_lens(camera),
        range_m=range_m,
        mount_height_m=mount_height_m,
        frame_interval_s=frame_interval_s,
    )


def depth_camera_facts(depth: LensCamera, colour: LensCamera, T_colour_depth: SE3) -> DepthCameraFacts | None:
    """None where depth is aligned with colour already: the same camera at the same place."""
    if depth == colour and np.allclose(T_colour_depth.as_matrix(), np.eye(4)):
        return None
    return DepthCameraFacts(**_pinhole(depth), lens=_lens(depth), pose=numbers_of(T_colour_depth))


def report_of(moment: Moment, *, time_s: float, command: int) -> Report:
    """Where a robot believes to be at that time of its clock; `command` is the newest that it obeys."""
    state = moment.state
    return Report(
        time_s=time_s,
        x_m=moment.estimate.x_m,
        y_m=moment.estimate.y_m,
        yaw_rad=moment.estimate.yaw_rad,
        path_length_m=state.path_length_m,
        standing=moment.standing,
        command=command,
        waypoints_passed=moment.waypoints_passed,
        arrived=moment.arrived,
        collisions=state.collisions,
        reversing=state.reversing,
    )


class _Pinhole(TypedDict):
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float


def _pinhole(camera: LensCamera) -> _Pinhole:
    facts = camera.intrinsics
    return {
        "width": facts.width,
        "height": facts.height,
        "fx": facts.fx,
        "fy": facts.fy,
        "cx": facts.cx,
        "cy": facts.cy,
    }


def _lens(camera: LensCamera) -> LensFacts:
    return LensFacts(
        model=camera.distortion.model, coefficients=[float(c) for c in camera.distortion.coefficients]
    )
