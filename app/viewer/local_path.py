"""Layer: the path through the selected viewpoints nearby, the one being driven."""

from __future__ import annotations

import viser

from app.missions.display import DisplayView
from app.viewer.palette import LOCAL_PATH
from app.viewer.polyline import FixedPolyline


class LocalPathLayer:
    title = "Local path"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._line = FixedPolyline(server, "/local_path", LOCAL_PATH, capacity=512, thickness_px=3.5)

    def update(self, view: DisplayView) -> None:
        on_floor = view.local_path_m.copy()
        on_floor[:, 2] = 0.12
        self._line.set_points(on_floor)

    def set_visible(self, visible: bool) -> None:
        self._line.set_visible(visible)
