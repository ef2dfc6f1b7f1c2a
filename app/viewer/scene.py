"""`MissionScene`: the 3D scene of the mission under way, and its controls."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

import numpy as np
import viser
from jaxtyping import Float
from numpy import ndarray

from app.missions.display import DisplayView
from app.settings import DisplaySettings
from app.viewer.camera import CameraLayer
from app.viewer.candidates import CandidateLayer
from app.viewer.floor import FloorLayer
from app.viewer.global_tour import GlobalTourLayer
from app.viewer.layer import Layer
from app.viewer.legend import legend_html
from app.viewer.local_path import LocalPathLayer
from app.viewer.points import PointLayer
from app.viewer.server import LOOPBACK, open_viser_server
from app.viewer.splats import SplatLayer
from app.viewer.subspaces import SubspaceLayer
from app.viewer.trajectory import TrajectoryLayer

log = logging.getLogger(__name__)

_HOME_OFFSET_M = np.array([-3.0, -6.5, 8.0])
"""From the middle of what is known to the camera of a fresh viewer."""


class MissionScene:
    """One viser server and the layers on it. The newest view wins: drawing never holds up a mission."""

    def __init__(self, display: DisplaySettings) -> None:
        self._display = display
        self._server = open_viser_server("Scene")
        self._server.scene.world_axes.visible = False
        self._server.scene.set_background_image(np.full((2, 2, 3), (22, 24, 29), np.uint8))
        self._splats = SplatLayer(self._server, capacity=display.max_splats, min_radius_m=display.min_splat_m)
        self._points = PointLayer(self._server, capacity=display.max_splats, point_size_m=display.min_splat_m)
        self._layers: list[Layer] = [
            self._splats,
            self._points,
            SubspaceLayer(self._server),
            CandidateLayer(self._server),
            TrajectoryLayer(self._server),
            GlobalTourLayer(self._server),
            LocalPathLayer(self._server),
            CameraLayer(self._server),
            FloorLayer(self._server),
        ]
        self._drawing = threading.Lock()
        self._mission: str | None = None
        self._shown: DisplayView | None = None
        self._robot_m: Float[ndarray, " 3"] | None = None
        self._following = False
        self._place_camera(np.zeros(3))
        self._build_controls()
        self._waiting: tuple[str, int, DisplayView] | None = None
        self._arrived = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        return f"http://{LOOPBACK}:{self._server.get_port()}"

    @property
    def mission_id(self) -> str | None:
        """The mission that is shown."""
        return self._mission

    @property
    def server(self) -> viser.ViserServer:
        return self._server

    def show(self, mission_id: str, sequence: int, view: DisplayView) -> None:
        """Show `view` soon; returns at once. A view that is overtaken by a newer one is never drawn."""
        with self._arrived:
            self._waiting = (mission_id, sequence, view)
            self._arrived.notify()

    def close(self) -> None:
        with self._arrived:
            self._closing = True
            self._arrived.notify()
        self._thread.join(5.0)
        self._server.stop()

    def _run(self) -> None:
        while True:
            with self._arrived:
                self._arrived.wait_for(lambda: self._waiting is not None or self._closing)
                if self._closing:
                    return
                assert self._waiting is not None
                mission_id, _, view = self._waiting
                self._waiting = None
            try:
                self._draw(mission_id, view)
            except Exception:
                log.exception("the 3D scene could not be updated")
            time.sleep(self._display.interval_s)  # a browser takes no more than about one update a second

    def _draw(self, mission_id: str, view: DisplayView) -> None:
        with self._drawing, self._server.atomic():
            if mission_id != self._mission:
                for layer in self._layers:
                    layer.clear()
                self._mission = mission_id
                self._robot_m = None
            for layer in self._layers:
                layer.update(view)
            self._move_cameras(view)
            self._shown = view

    def _move_cameras(self, view: DisplayView) -> None:
        """A fresh mission is brought into sight; a followed robot takes every camera along."""
        robot = view.robot_m.astype(np.float64)
        if self._robot_m is None:
            self._place_camera(robot)
            for client in self._server.get_clients().values():
                client.camera.position = robot + _HOME_OFFSET_M
                client.camera.look_at = robot
        elif self._following:
            moved = robot - self._robot_m
            if np.any(moved):
                for client in self._server.get_clients().values():
                    target = client.camera.look_at + moved
                    client.camera.position = client.camera.position + moved
                    client.camera.look_at = target
        self._robot_m = robot

    def _place_camera(self, target_m: Float[ndarray, " 3"]) -> None:
        self._server.initial_camera.position = target_m + _HOME_OFFSET_M
        self._server.initial_camera.look_at = target_m

    def _build_controls(self) -> None:
        gui = self._server.gui
        gui.main_panel.minimize()
        with gui.add_folder("Layers"):
            for layer in self._layers:
                self._add_switch(layer)
        with gui.add_folder("View"):
            hide = gui.add_checkbox("Hide ceiling", True, hint="Hide splats above the height below")
            height = gui.add_slider(
                "Height (m)", min=0.4, max=6.0, step=0.1, initial_value=self._display.clip_height_m
            )
            follow = gui.add_checkbox("Follow robot", False)
            overview = gui.add_button("From above")
        with gui.add_folder("Legend"):
            gui.add_html(legend_html(self._display.min_splat_m, self._display.max_splats))
        self._clip_at(self._display.clip_height_m)

        def clip(_: Any) -> None:
            with self._drawing:
                self._clip_at(height.value if hide.value else float("inf"))

        def set_following(_: Any) -> None:
            self._following = follow.value

        def look_from_above(event: Any) -> None:
            centre = self._centre_m()
            event.client.camera.position = centre + np.array([0.0, -0.5, 13.0])
            event.client.camera.look_at = centre

        hide.on_update(clip)
        height.on_update(clip)
        follow.on_update(set_following)
        overview.on_click(look_from_above)

    def _add_switch(self, layer: Layer) -> None:
        switch = self._server.gui.add_checkbox(layer.title, layer.shown_at_first)
        layer.set_visible(layer.shown_at_first)

        def apply(_: Any) -> None:
            with self._drawing:
                layer.set_visible(switch.value)
                if self._shown is not None:
                    layer.update(self._shown)

        switch.on_update(apply)

    def _clip_at(self, height_m: float) -> None:
        for layer in (self._splats, self._points):
            layer.clip_height_m = height_m
            if self._shown is not None:
                layer.update(self._shown)

    def _centre_m(self) -> Float[ndarray, " 3"]:
        """The middle of the shown map on the floor; the origin when there is none."""
        if self._shown is None or len(self._shown.splat_centres_m) == 0:
            return np.zeros(3)
        lower, upper = np.percentile(self._shown.splat_centres_m, [2, 98], axis=0)
        return np.array([(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, 0.0])
