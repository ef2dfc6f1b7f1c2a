"""Layer: the tour through the subspaces that are still to be finished."""

from __future__ import annotations

import viser

from app.missions.display import DisplayView
from app.viewer.palette import GLOBAL_TOUR
from app.viewer.polyline import FixedPolyline


class GlobalTourLayer:
    title = "Global tour"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._line = FixedPolyline(server, "/global_tour", GLOBAL_TOUR, capacity=512, thickness_px=2.5)

    def update(self, view: DisplayView) -> None:
        on_floor = view.global_tour_m.copy()
        on_floor[:, 2] = 0.09
        self._line.set_points(on_floor)

    def set_visible(self, visible: bool) -> None:
        self._line.set_visible(visible)
