"""Layer: the Gaussians' centres, as a point cloud. Draws fast everywhere and hides nothing."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser

from app.missions.display import DisplayView
from app.viewer.splats import splat_colours

TILE: Final = 20_000
_FAR_BELOW: Final = (0.0, 0.0, -1000.0)
"""Where unused points lie: a point cloud has no transparency."""


class PointLayer:
    """At most `capacity` points in tiles of fixed size; those above `clip_height_m` are hidden."""

    title = "Points"
    shown_at_first = False

    def __init__(self, server: viser.ViserServer, *, capacity: int, point_size_m: float) -> None:
        self._server = server
        self._capacity = capacity
        self._point_size_m = point_size_m
        self._tiles: list[viser.PointCloudHandle] = []
        self._visible = False
        self.clip_height_m = float("inf")
        self.shows_quality = False

    def update(self, view: DisplayView) -> None:
        if not self._visible:
            return  # costs as much as the splats: only while looked at
        shown = view.splat_centres_m[:, 2] <= self.clip_height_m
        centres = view.splat_centres_m[shown][: self._capacity]
        colours = splat_colours(view, shows_quality=self.shows_quality)[shown][: self._capacity]
        n_used = -(-len(centres) // TILE)
        for tile in range(max(n_used, len(self._tiles))):
            rows = slice(tile * TILE, (tile + 1) * TILE)
            points = np.full((TILE, 3), _FAR_BELOW, np.float32)
            points[: len(centres[rows])] = centres[rows]
            tints = np.zeros((TILE, 3), np.uint8)
            tints[: len(centres[rows])] = colours[rows]
            if tile < len(self._tiles):
                self._tiles[tile].points = points
                self._tiles[tile].colors = tints
            else:
                self._tiles.append(
                    self._server.scene.add_point_cloud(
                        f"/points/{tile}",
                        points,
                        tints,
                        point_size=self._point_size_m,
                        point_shape="circle",
                        precision="float32",
                        point_shading="flat",
                    )
                )

    def set_visible(self, visible: bool) -> None:
        self._visible = visible
        for tile in self._tiles:
            tile.visible = visible
