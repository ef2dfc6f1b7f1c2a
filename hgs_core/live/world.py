"""`LiveWorld`: a robot, a camera and a scanner that are somewhere else."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from hgs_core.errors import SensorError
from hgs_core.geometry.boxes import Box
from hgs_core.geometry.se3 import SE3
from hgs_core.live.carried_camera import CarriedCamera
from hgs_core.live.config import LiveConfig
from hgs_core.live.correspondence import Correspondence
from hgs_core.live.frame_reader import LiveFrame
from hgs_core.live.messages import End, Hello
from hgs_core.live.robot import LiveRobot
from hgs_core.robot.vehicle import Vehicle
from hgs_core.scene.sources.live import LIVE
from hgs_core.sensing.frame import Frame, Scan

_FRAME_S: Final = 1.0


class LiveWorld:
    """What a mission needs of a robot that has said hello and sent a frame. Camera and scanner are one: a
    frame brings both."""

    def __init__(
        self, correspondence: Correspondence, hello: Hello, vehicle: Vehicle, config: LiveConfig
    ) -> None:
        self.name = f"{LIVE}: {hello.name}"
        self.robot: LiveRobot | CarriedCamera
        self.correspondence = correspondence
        if hello.robot is not None and hello.report is not None:
            self.robot = robot = LiveRobot(correspondence, vehicle, config, hello.report)
            correspondence.listen_with(
                on_hello=robot.on_hello,
                on_report=robot.on_report,
                on_ack=robot.on_ack,
                on_beat=robot.on_beat,
            )
        else:
            self.robot = CarriedCamera(correspondence)
        self.region = _region(hello, config)
        self._latest: LiveFrame | None = None
        self._is_answered = False

    @property
    def camera(self) -> LiveWorld:
        return self

    @property
    def scanner(self) -> LiveWorld:
        return self

    def capture(self) -> Frame:
        """The newest frame; the one that `scan` belongs to."""
        return self._newest().frame

    def scan(self) -> Scan:
        """The scan that came with the next frame; one without rays from a robot that has no scanner."""
        self._take_next()
        latest = self._newest()
        if latest.scan is not None:
            return latest.scan
        return Scan(
            origin_m=latest.frame.T_world_camera.translation.copy(),
            bearings_rad=np.zeros(0),
            ranges_m=np.zeros(0, np.float32),
            timestamp_s=latest.frame.timestamp_s,
        )

    def mapped(self, frame: Frame) -> None:
        """The frame is in the map: the robot is told, once."""
        if not self._is_answered:
            self._is_answered = True
            self.correspondence.answer(frame.sequence, "taken")

    @property
    def over(self) -> str | None:
        """Why nothing more will come, once everything that came has been taken."""
        return None if self.correspondence.has_frame else self.correspondence.over

    def why_wait(self) -> str | None:
        return self.correspondence.why_wait()

    def end(self, reason: str) -> None:
        """The mission is over: once it stands, the robot may go."""
        self.robot.stop()
        self.robot.advance(self.robot.standing_in_s)
        self.correspondence.send(End(now_s=self.correspondence.now_s, reason=reason))

    def leave(self) -> None:
        """The mission is over, or goes on in another process: let the robot stand, and say nothing more."""
        self.robot.stop()
        self.correspondence.close()

    def state(self) -> dict[str, Any]:
        return {"correspondence": self.correspondence.state(), "robot": self.robot.state_to_keep()}

    def restore(self, state: dict[str, Any]) -> None:
        """What a robot counts; the correspondence began with its part of the state."""
        self.robot.restore(state["robot"])

    def _take_next(self) -> None:
        correspondence = self.correspondence
        # There is one, unless the robot came back or left this very moment.
        correspondence.wait_for_news(
            _FRAME_S, lambda: correspondence.has_frame or correspondence.over is not None
        )
        taken = correspondence.take_frame()
        if taken is None:
            return
        self._latest, self._is_answered = taken, False
        if isinstance(self.robot, LiveRobot):
            self.robot.has_seen(taken.report)
        else:
            self.robot.has_moved(*_floor_pose(taken.frame.T_world_camera))

    def _newest(self) -> LiveFrame:
        if self._latest is None:
            raise SensorError("no frame has come: a mission begins with one")
        return self._latest


def _floor_pose(T_world_camera: SE3) -> tuple[float, float, float]:
    x, y, _ = T_world_camera.translation.tolist()
    ahead = T_world_camera.rotation[:, 2]
    return x, y, math.atan2(float(ahead[1]), float(ahead[0]))


def _region(hello: Hello, config: LiveConfig) -> Box | None:
    """What the robot names; about a robot that drives, the preset's extent; elsewhere no bounds."""
    if hello.region_m is not None:
        lower, upper = np.array(hello.region_m, dtype=np.float64)
        return Box(lower_m=lower, upper_m=upper)
    if hello.report is None:
        return None
    here, half = np.array([hello.report.x_m, hello.report.y_m]), 0.5 * config.extent_m
    return Box(
        lower_m=np.array([*(here - half), -0.2]),
        upper_m=np.array([*(here + half), config.height_m]),
    )
