"""A polyline in a buffer of fixed size: the browser never has to allocate a new one."""

from __future__ import annotations

import numpy as np
import viser
from jaxtyping import Float, Float32
from numpy import ndarray

from app.viewer.palette import RGB


class FixedPolyline:
    """At most `capacity` straight pieces; longer lines are thinned, unused pieces have no length."""

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        colour: RGB,
        *,
        capacity: int,
        thickness_px: float,
    ) -> None:
        self._capacity = capacity
        self._node = server.scene.add_line_segments(
            name,
            np.zeros((capacity, 2, 3), np.float32),
            np.array(colour, np.uint8),
            thickness=thickness_px,
            thickness_units="screen",
        )

    def set_points(self, points_m: Float[ndarray, "n 3"]) -> None:
        self._node.points = padded_segments(points_m, self._capacity)

    def set_visible(self, visible: bool) -> None:
        self._node.visible = visible


def padded_segments(points_m: Float[ndarray, "n 3"], capacity: int) -> Float32[ndarray, "capacity 2 3"]:
    """The pieces between consecutive points, then pieces of no length."""
    segments = np.zeros((capacity, 2, 3), np.float32)
    if len(points_m) == 0:
        return segments
    points = np.asarray(points_m, np.float32)
    if len(points) > capacity + 1:
        points = points[np.linspace(0, len(points) - 1, capacity + 1).round().astype(int)]
    n_pieces = len(points) - 1
    segments[:n_pieces, 0] = points[:-1]
    segments[:n_pieces, 1] = points[1:]
    segments[n_pieces:] = points[-1]
    return segments
