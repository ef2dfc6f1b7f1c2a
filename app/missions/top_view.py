"""A map from above without its ceiling, drawn from a `DisplayView`: quickly, as pages ask every second."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float, Float32, Int, UInt8
from numpy import ndarray
from PIL import Image

from app.missions.display import SUBSPACE_STATES, DisplayView

PIXEL_M: Final = 0.025
"""Finest pixel of the drawn map [m]; large maps get coarser ones: no picture has more than `MAX_PX`."""
MAX_PX: Final = 720
"""Most pixels along the longer side."""
MAX_POINTS: Final = 1_000
"""Most points of one line that is told."""
_BORDER_M: Final = 0.25
_OUTLIERS: Final = 0.001
"""This share of the splats at either end may lie outside the picture."""
_WIDEST_PX: Final = 2
_CLOSED_PX: Final = 2
"""Gaps up to twice as wide between spots of a thinned-out map are closed."""
_NEIGHBOURS: Final = tuple((down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if down or right)
_SEEN: Final = 64
"""Least opacity (0..255) of a splat that is drawn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TopView:
    """Row 0 of the image is the largest y; transparent is what no splat covers."""

    image: UInt8[ndarray, "h w 4"]
    lower_m: tuple[float, float]
    """x and y of the image's lower left corner."""
    pixel_m: float

    @property
    def upper_m(self) -> tuple[float, float]:
        height, width = self.image.shape[:2]
        return (self.lower_m[0] + width * self.pixel_m, self.lower_m[1] + height * self.pixel_m)

    def png(self) -> bytes:
        """With at most 256 colours, which makes it a third as large and looks the same on a map."""
        stream = io.BytesIO()
        reduced = Image.fromarray(self.image).quantize(256, method=Image.Quantize.FASTOCTREE)
        reduced.save(stream, "PNG", compress_level=4)
        return stream.getvalue()


def top_view(view: DisplayView, *, below_m: float) -> TopView:
    """The splats with centres below `below_m`, the higher one over the lower one."""
    shown = (view.splat_centres_m[:, 2] < below_m) & (view.splat_opacities >= _SEEN)
    if not shown.any():
        return TopView(image=np.zeros((1, 1, 4), np.uint8), lower_m=(0.0, 0.0), pixel_m=PIXEL_M)
    low, high = np.quantile(view.splat_centres_m[shown, :2], (_OUTLIERS, 1 - _OUTLIERS), axis=0)
    low, high = low - _BORDER_M, high + _BORDER_M
    shown &= ((view.splat_centres_m[:, :2] > low) & (view.splat_centres_m[:, :2] < high)).all(axis=1)
    pixel_m = max(PIXEL_M, float((high - low).max()) / MAX_PX)
    width, height = (max(1, math.ceil(side / pixel_m)) for side in high - low)
    upwards = np.flatnonzero(shown)[np.argsort(view.splat_centres_m[shown, 2])]
    centres = view.splat_centres_m[upwards]
    columns = ((centres[:, 0] - low[0]) / pixel_m).astype(np.int64)
    rows = height - 1 - ((centres[:, 1] - low[1]) / pixel_m).astype(np.int64)
    image = _painted(
        columns,
        rows,
        centres[:, 2],
        view.splat_rgb[upwards],
        view.splat_radii_m[upwards] / pixel_m,
        (height, width),
    )
    return TopView(image=_closed(image), lower_m=(float(low[0]), float(low[1])), pixel_m=pixel_m)


def _painted(
    columns: Int[ndarray, " n"],
    rows: Int[ndarray, " n"],
    heights_m: Float32[ndarray, " n"],
    colours: UInt8[ndarray, "n 3"],
    radii_px: Float32[ndarray, " n"],
    shape: tuple[int, int],
) -> UInt8[ndarray, "h w 4"]:
    """Round spots in order of height. Within one offset the last, highest one stays, as NumPy assigns."""
    height, width = (side + 2 * _WIDEST_PX for side in shape)
    image = np.zeros((height * width, 4), np.uint8)
    top_m = np.full(height * width, -np.inf, np.float32)
    middles = (rows + _WIDEST_PX) * width + columns + _WIDEST_PX
    for down in range(-_WIDEST_PX, _WIDEST_PX + 1):
        for right in range(-_WIDEST_PX, _WIDEST_PX + 1):
            distance = math.hypot(down, right)
            if distance > _WIDEST_PX:
                continue
            reaching = np.flatnonzero(radii_px >= distance - 0.5)
            places = middles[reaching] + down * width + right
            higher = heights_m[reaching] > top_m[places]
            reaching, places = reaching[higher], places[higher]
            top_m[places] = heights_m[reaching]
            image[places, :3] = colours[reaching]
            image[places, 3] = 255
    border = slice(_WIDEST_PX, -_WIDEST_PX)
    return image.reshape(height, width, 4)[border, border]


def _closed(image: UInt8[ndarray, "h w 4"]) -> UInt8[ndarray, "h w 4"]:
    """Clear pixels that are half surrounded get the mean colour of those around them."""
    image = image.copy()
    for _ in range(_CLOSED_PX):
        padded = np.pad(image, ((1, 1), (1, 1), (0, 0)))
        clear = np.argwhere(image[..., 3] == 0)
        around = np.stack(
            [padded[clear[:, 0] + 1 + down, clear[:, 1] + 1 + right] for down, right in _NEIGHBOURS], axis=1
        ).astype(np.float32)
        n_set = (around[..., 3] > 0).sum(axis=1)
        filled = n_set >= len(_NEIGHBOURS) // 2
        means = around[filled, :, :3].sum(axis=1) / n_set[filled, None]
        image[clear[filled, 0], clear[filled, 1], :3] = (means + 0.5).astype(np.uint8)
        image[clear[filled, 0], clear[filled, 1], 3] = 255
    return image


def top_view_facts(view: DisplayView, drawn: TopView) -> dict[str, Any]:
    """What a page draws over the picture, as plain data in metres; see `app.schemas.TopViewFacts`."""
    looking = view.T_world_camera[:2, 2]
    width_px, _, focal_px, _ = view.camera
    return {
        "time_s": view.time_s,
        "lower_m": _rounded(drawn.lower_m),
        "upper_m": _rounded(drawn.upper_m),
        "robot": {
            "x_m": round(float(view.robot_m[0]), 3),
            "y_m": round(float(view.robot_m[1]), 3),
            "yaw_deg": round(math.degrees(math.atan2(looking[1], looking[0])), 1),
        },
        "field_of_view_deg": round(math.degrees(2 * math.atan2(width_px / 2, focal_px)), 1),
        "trajectory": _line(view.trajectory_m),
        "local_path": _line(view.local_path_m),
        "global_tour": _line(view.global_tour_m),
        "subspaces": [
            {
                "lower_m": _rounded(bounds[:2]),
                "upper_m": _rounded(bounds[3:5]),
                "state": SUBSPACE_STATES[state],
            }
            for bounds, state in zip(view.subspace_bounds_m, view.subspace_states, strict=True)
        ],
    }


def _line(points_m: Float[ndarray, "n 3"]) -> list[list[float]]:
    if len(points_m) > MAX_POINTS:
        points_m = points_m[np.linspace(0, len(points_m) - 1, MAX_POINTS).round().astype(int)]
    return [_rounded(point[:2]) for point in points_m]


def _rounded(point: Any) -> list[float]:
    return [round(float(value), 3) for value in point]
