"""Colours of the 3D scene: Okabe and Ito's set, told apart with every common colour deficiency."""

from __future__ import annotations

from typing import Final

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

RGB = tuple[int, int, int]

ORANGE: Final[RGB] = (230, 159, 0)
SKY: Final[RGB] = (86, 180, 233)
GREEN: Final[RGB] = (0, 158, 115)
YELLOW: Final[RGB] = (240, 228, 66)
BLUE: Final[RGB] = (0, 114, 178)
VERMILLION: Final[RGB] = (213, 94, 0)
PURPLE: Final[RGB] = (204, 121, 167)
WHITE: Final[RGB] = (240, 240, 240)
GREY: Final[RGB] = (140, 140, 146)
DIM: Final[RGB] = (100, 102, 112)

SUBSPACE: Final[dict[str, RGB]] = {
    "reconstructed": GREEN,
    "reconstructing": ORANGE,
    "unreconstructed": DIM,
}
TRAJECTORY: Final = WHITE
GLOBAL_TOUR: Final = PURPLE
LOCAL_PATH: Final = SKY
CAMERA: Final = YELLOW
REJECTED: Final = GREY
VOXEL: Final[dict[str, RGB]] = {"occupied": BLUE, "frontier": YELLOW, "missing": VERMILLION}
ROADMAP: Final = GREY
REGION: Final = GREEN
NO_GO: Final = VERMILLION


def as_linear(colours: UInt8[ndarray, "*shape 3"]) -> UInt8[ndarray, "*shape 3"]:
    """sRGB colours as viser wants them for single instances and vertices, which it takes for linear light."""
    shares = colours / 255.0
    linear = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return (linear * 255.0 + 0.5).astype(np.uint8)


def css(colour: RGB) -> str:
    return f"rgb({colour[0]}, {colour[1]}, {colour[2]})"
