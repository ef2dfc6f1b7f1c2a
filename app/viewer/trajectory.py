"""Layer: the path driven so far."""

from __future__ import annotations

import viser

from app.missions.display import DisplayView
from app.viewer.palette import TRAJECTORY
from app.viewer.polyline import FixedPolyline


class TrajectoryLayer:
    title = "Driven path"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._line = FixedPolyline(server, "/trajectory", TRAJECTORY, capacity=2_000, thickness_px=2.5)

    def update(self, view: DisplayView) -> None:
        on_floor = view.trajectory_m.copy()
        on_floor[:, 2] = 0.06
        self._line.set_points(on_floor)

    def set_visible(self, visible: bool) -> None:
        self._line.set_visible(visible)
