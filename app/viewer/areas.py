"""Layer: the operator's region of interest, and the areas that the robot does not enter, hatched."""

from __future__ import annotations

from typing import Final

import numpy as np
import viser
from jaxtyping import Float32, UInt8
from numpy import ndarray

from app.missions.display import MAX_AREA_CORNERS, DisplayView
from app.viewer.palette import NO_GO, REGION, as_linear

MAX_HATCHES: Final = 2_000
CAPACITY: Final = MAX_AREA_CORNERS + MAX_HATCHES
_SPACING_M: Final = 0.25
_HEIGHT_M: Final = 0.08


class AreaLayer:
    title = "Region and no-go areas"
    shown_at_first = True

    def __init__(self, server: viser.ViserServer) -> None:
        self._node = server.scene.add_line_segments(
            "/areas",
            np.zeros((CAPACITY, 2, 3), np.float32),
            np.zeros((CAPACITY, 2, 3), np.uint8),
            thickness=3.0,
            thickness_units="screen",
        )

    def update(self, view: DisplayView) -> None:
        parts = [(outline(view.region_m), REGION)] if len(view.region_m) else []
        for area in areas_in(view.no_go_m, view.no_go_sizes):
            parts += [(outline(area), NO_GO), (hatches(area), NO_GO)]
        points = np.zeros((CAPACITY, 2, 3), np.float32)
        tints = np.zeros((CAPACITY, 2, 3), np.uint8)
        first = 0
        for segments, colour in parts:
            last = min(first + len(segments), CAPACITY)
            points[first:last, :, :2] = segments[: last - first]
            points[first:last, :, 2] = _HEIGHT_M
            tints[first:last] = as_linear(np.array(colour, np.uint8))
            first = last
        self._node.points = points
        self._node.colors = tints

    def set_visible(self, visible: bool) -> None:
        self._node.visible = visible


def areas_in(corners: Float32[ndarray, "n 2"], sizes: UInt8[ndarray, " k"]) -> list[Float32[ndarray, "_ 2"]]:
    """The areas whose corners lie one after another."""
    return np.split(corners, np.cumsum(sizes.astype(np.int64))[:-1]) if len(sizes) else []


def outline(area: Float32[ndarray, "n 2"]) -> Float32[ndarray, "n 2 2"]:
    """Its edges."""
    return np.stack([area, np.roll(area, -1, axis=0)], axis=1)


def hatches(area: Float32[ndarray, "n 2"]) -> Float32[ndarray, "m 2 2"]:
    """Lines along the diagonal inside the area, `_SPACING_M` apart, or farther where that were too many."""
    offsets = area[:, 1] - area[:, 0]  # of the lines y = x + offset through each corner
    low, high = float(offsets.min()), float(offsets.max())
    spacing = max(_SPACING_M * np.sqrt(2.0), (high - low) / 60.0)
    found = []
    for offset in np.arange(low + spacing / 2, high, spacing):
        before, after = offsets - offset, np.roll(offsets, -1) - offset
        crosses = (before > 0) != (after > 0)
        share = before[crosses] / (before[crosses] - after[crosses])
        at = area[crosses] + share[:, None] * (np.roll(area, -1, axis=0)[crosses] - area[crosses])
        at = at[np.argsort(at[:, 0])]
        found += [at[k : k + 2] for k in range(0, len(at) - 1, 2)]
    return np.array(found, np.float32).reshape(-1, 2, 2)
