"""Where the viewers' cameras stand: over the whole map, along with the robot, or where a hand put them."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Final

import numpy as np
import viser
from jaxtyping import Float
from numpy import ndarray

from app.missions.display import DisplayView

_FOV_RAD: Final = math.radians(50.0)
_SLANT: Final = np.array([-0.28, -0.62, 0.74])
"""From the map to the camera: high enough to see into the rooms, slanted enough to see their walls."""
_MARGIN: Final = 1.15
_RADIUS_AT_START_M: Final = 5.0
_SAME_PLACE_M: Final = 0.05


class CameraMode(StrEnum):
    WHOLE_MAP = "Whole map"
    FOLLOW_ROBOT = "Follow robot"
    FREE = "Free"


class Framing:
    """Moves every connected camera after each view, except those that somebody has moved by hand.

    A camera that has arrived where it was put, and then is somewhere else, has been moved by its user. It is
    left alone until the mode is chosen anew.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._mode = CameraMode.WHOLE_MAP
        self._centre_m = np.zeros(3)
        self._radius_m = _RADIUS_AT_START_M
        self._robot_m: Float[ndarray, " 3"] | None = None
        self._put: dict[int, Float[ndarray, " 3"]] = {}
        self._arrived: set[int] = set()
        self._released: set[int] = set()
        server.initial_camera.fov = _FOV_RAD
        self._set_initial_camera()

    def choose(self, mode: CameraMode) -> None:
        """Take every camera in hand again."""
        self._mode = mode
        self._released.clear()
        self._put.clear()
        if mode is CameraMode.WHOLE_MAP:
            self._place_all()

    def update(self, view: DisplayView) -> None:
        robot = view.robot_m.astype(np.float64)
        grown = self._measure(view)
        self._release_moved_cameras()
        if self._mode is CameraMode.WHOLE_MAP and (grown or self._robot_m is None):
            self._place_all()
        elif self._mode is CameraMode.FOLLOW_ROBOT and self._robot_m is not None:
            self._carry_all(robot - self._robot_m)
        if grown or self._robot_m is None:
            self._set_initial_camera()
        self._robot_m = robot

    def _measure(self, view: DisplayView) -> bool:
        """Take in the extent of the map; whether it has changed enough to matter."""
        if len(view.splat_centres_m) == 0:
            return False
        lower, upper = np.percentile(view.splat_centres_m[:, :2], [1.0, 99.0], axis=0)
        centre = np.append((lower + upper) / 2, 0.4).astype(np.float64)
        radius = max(float(np.linalg.norm(upper - lower)) / 2, 2.0)
        moved = float(np.linalg.norm(centre - self._centre_m))
        if moved < 0.1 * self._radius_m and abs(radius - self._radius_m) < 0.1 * self._radius_m:
            return False
        self._centre_m, self._radius_m = centre, radius
        return True

    def _home(self) -> Float[ndarray, " 3"]:
        distance = _MARGIN * self._radius_m / math.tan(_FOV_RAD / 2)
        return self._centre_m + distance * _SLANT / np.linalg.norm(_SLANT)

    def _set_initial_camera(self) -> None:
        self._server.initial_camera.position = self._home()
        self._server.initial_camera.look_at = self._centre_m

    def _place_all(self) -> None:
        for number, client in self._server.get_clients().items():
            if number not in self._released:
                self._put_camera(number, client, self._home(), self._centre_m)

    def _carry_all(self, moved_m: Float[ndarray, " 3"]) -> None:
        """The robot's motion, added to each camera; a hand on the camera does not end this."""
        if not np.any(moved_m):
            return
        for number, client in self._server.get_clients().items():
            self._put_camera(
                number, client, client.camera.position + moved_m, client.camera.look_at + moved_m
            )

    def _put_camera(
        self,
        number: int,
        client: viser.ClientHandle,
        position_m: Float[ndarray, " 3"],
        look_at_m: Float[ndarray, " 3"],
    ) -> None:
        client.camera.position = position_m
        client.camera.look_at = look_at_m
        self._put[number] = np.asarray(position_m, float)
        self._arrived.discard(number)

    def _release_moved_cameras(self) -> None:
        clients = self._server.get_clients()
        for number in list(self._put):
            if number not in clients:
                del self._put[number]
                continue
            off = np.linalg.norm(clients[number].camera.position - self._put[number])
            if off < _SAME_PLACE_M:
                self._arrived.add(number)
            elif number in self._arrived:
                self._released.add(number)
