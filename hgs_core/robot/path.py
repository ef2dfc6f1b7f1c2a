"""Paths on the floor plane."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import RobotError


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """Waypoints to drive through in order, beginning at the robot's position.

    `yaws_rad[i]` is the heading to take up, standing, at waypoint `i` (a viewpoint); NaN = drive on.
    Between waypoints the robot drives straight. `Path.empty()` has no waypoints.

    A path for a car has its heading at every waypoint, the yaws' included: between them it drives arcs, and
    backwards where its heading points away from the next.
    """

    positions_m: Float[ndarray, "n 2"]
    yaws_rad: Float[ndarray, " n"]
    headings_rad: Float[ndarray, " n"] | None = None

    def __post_init__(self) -> None:
        if self.headings_rad is not None and self.headings_rad.shape != self.yaws_rad.shape:
            raise RobotError(f"path has {len(self.headings_rad)} headings for {len(self.yaws_rad)} yaws")
        if self.positions_m.shape != (len(self.yaws_rad), 2):
            raise RobotError(
                f"path has positions {self.positions_m.shape} for {len(self.yaws_rad)} yaws; "
                "expected (n, 2) and (n,)"
            )

    @staticmethod
    def empty() -> Path:
        return Path(positions_m=np.zeros((0, 2)), yaws_rad=np.zeros(0))

    @staticmethod
    def full_turn(x_m: float, y_m: float, yaw_rad: float) -> Path:
        """All round on the spot, in three looks: a level camera knows nothing of what is behind it."""
        turns = yaw_rad + np.radians([120.0, 240.0, 360.0])
        return Path(positions_m=np.tile([x_m, y_m], (len(turns), 1)), yaws_rad=turns)

    def state(self) -> dict[str, Any]:
        """The constructor's arguments."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def to_first_view(self) -> Path:
        """The path as far as its first viewpoint, there included; all of it where there is none."""
        views = np.flatnonzero(np.isfinite(self.yaws_rad))
        end = int(views[0]) + 1 if len(views) else len(self.yaws_rad)
        headings = None if self.headings_rad is None else self.headings_rad[:end]
        return Path(positions_m=self.positions_m[:end], yaws_rad=self.yaws_rad[:end], headings_rad=headings)

    def without_first(self) -> Path:
        """The path from its second waypoint on."""
        headings = None if self.headings_rad is None else self.headings_rad[1:]
        return Path(positions_m=self.positions_m[1:], yaws_rad=self.yaws_rad[1:], headings_rad=headings)

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1).sum())
