"""Layer: the robot's camera: where it looks from, and what it sees."""

from __future__ import annotations

import math

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from app.missions.display import DisplayView
from app.viewer.palette import CAMERA


class CameraLayer:
    title = "Camera"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._frustum = server.scene.add_camera_frustum(
            "/camera/frustum",
            fov=math.radians(60.0),
            aspect=16 / 9,
            scale=0.45,
            color=CAMERA,
            thickness=2.5,
            thickness_units="screen",
            jpeg_quality=80,
            visible=False,
        )
        self._body = server.scene.add_cylinder(
            "/camera/body",
            radius=0.25,
            height=0.9,
            color=CAMERA,
            opacity=0.45,
            visible=False,
            cast_shadow=False,
        )
        self._visible = True
        self._posed = False

    def update(self, view: DisplayView) -> None:
        pose = view.T_world_camera
        width, height, _, fy = (float(value) for value in view.camera)
        self._frustum.fov = 2 * math.atan(height / 2 / fy)
        self._frustum.aspect = width / height
        self._frustum.image = view.observed[::2, ::2]
        self._frustum.wxyz = np.asarray(Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True))
        self._frustum.position = pose[:3, 3]
        self._body.position = np.array([pose[0, 3], pose[1, 3], 0.45])
        self._posed = True
        self._apply()

    def set_visible(self, visible: bool) -> None:
        self._visible = visible
        self._apply()

    def _apply(self) -> None:
        self._frustum.visible = self._visible and self._posed
        self._body.visible = self._visible and self._posed
