"""Colours of the 3D scene: Okabe and Ito's set, told apart with every common colour deficiency."""

from __future__ import annotations

from typing import Final

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

SUBSPACE: Final[dict[str, RGB]] = {
    "reconstructed": GREEN,
    "reconstructing": ORANGE,
    "unreconstructed": GREY,
}
TRAJECTORY: Final = WHITE
GLOBAL_TOUR: Final = PURPLE
LOCAL_PATH: Final = SKY
CAMERA: Final = YELLOW
REJECTED: Final = GREY


def css(colour: RGB) -> str:
    return f"rgb({colour[0]}, {colour[1]}, {colour[2]})"
