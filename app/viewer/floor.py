"""Layer: a grid on the floor, one metre a cell."""

from __future__ import annotations

import viser

from app.missions.display import DisplayView


class FloorLayer:
    title = "Floor grid (1 m)"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._grid = server.scene.add_grid(
            "/floor",
            width=60.0,
            height=60.0,
            plane="xy",
            cell_size=1.0,
            cell_color=(64, 66, 74),
            section_size=5.0,
            section_color=(92, 95, 106),
            infinite_grid=False,
            position=(0.0, 0.0, -0.02),
            shadow_opacity=0.0,
        )

    def update(self, view: DisplayView) -> None:
        """The floor stays where it is."""

    def set_visible(self, visible: bool) -> None:
        self._grid.visible = visible
