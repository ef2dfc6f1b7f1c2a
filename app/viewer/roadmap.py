"""Layer: the roadmap of the global level, its edges that can be driven. Other planners have none."""

from __future__ import annotations

import numpy as np
import viser

from app.missions.display import MAX_EDGES, DisplayView
from app.viewer.palette import ROADMAP

_HEIGHT_M = 0.04


class RoadmapLayer:
    title = "Roadmap"
    shown_at_first = False

    def __init__(self, server: viser.ViserServer) -> None:
        self._node = server.scene.add_line_segments(
            "/roadmap",
            np.zeros((MAX_EDGES, 2, 3), np.float32),
            np.array(ROADMAP, np.uint8),
            thickness=1.5,
            thickness_units="screen",
            visible=False,
        )

    def update(self, view: DisplayView) -> None:
        segments = np.zeros((MAX_EDGES, 2, 3), np.float32)
        n_edges = min(len(view.roadmap_m), MAX_EDGES)
        segments[:n_edges, :, :2] = view.roadmap_m[:n_edges]
        segments[:, :, 2] = _HEIGHT_M
        self._node.points = segments

    def set_visible(self, visible: bool) -> None:
        self._node.visible = visible
