"""`Directives`: what an operator may ask of a mission, before it begins or while it runs."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import AfterValidator, Field

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.polygons import area_m2, crossing_edges

LEAST_AREA_M2: Final = 0.01
"""A polygon that encloses less is a slip of the hand."""


def _well_formed(corners: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    corners_m = np.array(corners, dtype=np.float64)
    crossing = crossing_edges(corners_m)
    if crossing is not None:
        first, second = crossing
        raise ValueError(
            f"the outline crosses itself: its edges from corner {first} and from corner {second} meet"
        )
    if area_m2(corners_m) < LEAST_AREA_M2:
        raise ValueError(f"the outline encloses {area_m2(corners_m):.4f} m^2; at least {LEAST_AREA_M2} m^2")
    return corners


Coordinate = Annotated[float, Field(strict=True, ge=-1e6, le=1e6, allow_inf_nan=False)]
Corner = Annotated[tuple[Coordinate, ...], Field(min_length=2, max_length=2)]
"""x, y [m]."""
Outline = Annotated[
    tuple[Corner, ...],
    Field(min_length=3, max_length=64),
    AfterValidator(_well_formed),
]
"""The corners of a polygon in world metres, in order; its edges do not cross."""


class Directives(StrictConfig):
    """What the operator asks of a mission. By default nothing: it explores all that it can reach.

    A mission takes them at the boundary of a step, all together, as one logged event.
    """

    region: Outline | None = Field(None, examples=[[[0.5, 0.5], [6.0, 0.5], [6.0, 4.0], [0.5, 4.0]]])
    """Only what lies in here is worth seeing, and views are taken here alone; elsewhere the robot only drives
    through. While no floor inside is known to be reachable, it looks for the way. None: everything."""
    no_go: tuple[Outline, ...] = Field((), max_length=32, examples=[[[[2.0, 1.0], [3.0, 1.0], [3.0, 2.0]]]])
    """No part of the robot enters these areas; its sensors may look into them."""
    max_speed_m_s: float | None = Field(None, strict=True, ge=0.01, le=100, examples=[0.4])
    """The robot drives no faster, and never faster than it can [m/s]. None: as fast as it can."""
    max_path_m: float | None = Field(None, strict=True, gt=0, le=1e6, examples=[60.0])
    """The mission ends before the robot has driven farther than this in all [m]. None: no limit."""
    return_to_start: bool = Field(False, strict=True, examples=[True])
    """The robot is back where it began when the mission ends by itself, and `max_path_m` lasts for the way
    back; that way comes on top of a time limit."""
    approve_views: bool = Field(False, strict=True, examples=[False])
    """The robot waits for the operator's word before it drives to a new view."""

    @cached_property
    def region_m(self) -> Float[ndarray, "n_corners 2"] | None:
        """`region` as an array."""
        return None if self.region is None else np.array(self.region, dtype=np.float64)

    @cached_property
    def no_go_m(self) -> tuple[Float[ndarray, "n_corners 2"], ...]:
        """`no_go` as arrays."""
        return tuple(np.array(outline, dtype=np.float64) for outline in self.no_go)
