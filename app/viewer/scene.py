"""`MissionScene`: the 3D scene of one mission, and its controls."""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import viser

from app.missions.display import DisplayView
from app.settings import DisplaySettings
from app.viewer.areas import AreaLayer
from app.viewer.camera import CameraLayer
from app.viewer.candidates import CandidateLayer
from app.viewer.floor import FloorLayer
from app.viewer.framing import CameraMode, Framing
from app.viewer.global_tour import GlobalTourLayer
from app.viewer.layer import Layer
from app.viewer.legend import legend_html
from app.viewer.local_path import LocalPathLayer
from app.viewer.mesh import MeshLayer
from app.viewer.panorama import PanoramaPanel
from app.viewer.points import PointLayer
from app.viewer.roadmap import RoadmapLayer
from app.viewer.server import LOOPBACK, open_viser_server
from app.viewer.splats import SplatLayer
from app.viewer.subspaces import SubspaceLayer
from app.viewer.trajectory import TrajectoryLayer
from app.viewer.voxels import VoxelLayer

log = logging.getLogger(__name__)


class MissionScene:
    """One viser server and the layers on it. The newest view wins: drawing never holds up a mission."""

    def __init__(self, display: DisplaySettings, mesh_file: Path | None = None) -> None:
        """`mesh_file`: where the mission leaves its mesh, once it has ended."""
        self._display = display
        self._server = open_viser_server("Scene")
        self._server.scene.world_axes.visible = False
        self._server.scene.set_background_image(np.full((2, 2, 3), (22, 24, 29), np.uint8))
        self._splats = SplatLayer(self._server, capacity=display.max_splats, min_radius_m=display.min_splat_m)
        self._points = PointLayer(self._server, capacity=display.max_splats, point_size_m=display.min_splat_m)
        self._voxels = VoxelLayer(self._server)
        self._layers: list[Layer] = [
            self._splats,
            self._points,
            MeshLayer(self._server, mesh_file),
            self._voxels,
            SubspaceLayer(self._server),
            CandidateLayer(self._server),
            TrajectoryLayer(self._server),
            GlobalTourLayer(self._server),
            LocalPathLayer(self._server),
            RoadmapLayer(self._server),
            AreaLayer(self._server),
            CameraLayer(self._server),
            FloorLayer(self._server),
        ]
        self._drawing = threading.Lock()
        self._shown: DisplayView | None = None
        self._framing = Framing(self._server)
        self._build_controls()
        self._waiting: DisplayView | None = None
        self._arrived = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        return f"http://{LOOPBACK}:{self._server.get_port()}"

    @property
    def server(self) -> viser.ViserServer:
        return self._server

    def show(self, view: DisplayView) -> None:
        """Show `view` soon; returns at once. A view that is overtaken by a newer one is never drawn."""
        with self._arrived:
            self._waiting = view
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
                view, self._waiting = self._waiting, None
            try:
                self._draw(view)
            except Exception as error:
                log.exception("the 3D scene could not be updated")
                self._tell_trouble(f"not up to date since {view.time_s:.0f} s of the mission: {error}")
            else:
                self._tell_trouble("")
            time.sleep(self._display.interval_s)  # a browser takes no more than about one update a second

    def _tell_trouble(self, trouble: str) -> None:
        """At the top of the controls, and gone when there is none."""
        if self._trouble.content != trouble:
            self._trouble.content = trouble
            self._trouble.visible = bool(trouble)

    def _draw(self, view: DisplayView) -> None:
        with self._drawing, self._server.atomic():
            for layer in self._layers:
                layer.update(view)
            self._framing.update(view)
            self._panorama.update(view)
            self._shown = view

    def _build_controls(self) -> None:
        gui = self._server.gui
        gui.main_panel.minimize()
        self._trouble = gui.add_markdown("", visible=False)
        with gui.add_folder("Layers"):
            for layer in self._layers:
                self._add_switch(layer)
        with gui.add_folder("View"):
            hide = gui.add_checkbox("Hide ceiling", True, hint="Hide splats above the height below")
            height = gui.add_slider(
                "Height (m)", min=0.4, max=6.0, step=0.1, initial_value=self._display.clip_height_m
            )
            mode = gui.add_button_group("Camera", tuple(CameraMode))
            colours = gui.add_button_group("Colours", ("Photo", "Uncertainty"))
        self._panorama = PanoramaPanel(self._server)
        with gui.add_folder("Legend"):
            gui.add_html(legend_html(self._display.min_splat_m, self._display.max_splats))
        self._clip_at(self._display.clip_height_m)

        def clip(_: Any) -> None:
            with self._drawing:
                self._clip_at(height.value if hide.value else float("inf"))

        def colour(_: Any) -> None:
            with self._drawing:
                for layer in (self._splats, self._points):
                    layer.shows_quality = colours.value == "Uncertainty"
                    if self._shown is not None:
                        layer.update(self._shown)

        def choose(_: Any) -> None:
            with self._drawing:
                self._framing.choose(CameraMode(mode.value))

        hide.on_update(clip)
        height.on_update(clip)
        mode.on_click(choose)
        colours.on_click(colour)

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
        for layer in (self._splats, self._points, self._voxels):
            layer.clip_height_m = height_m
            if self._shown is not None:
                layer.update(self._shown)
