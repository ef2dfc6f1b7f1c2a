"""Paths on the floor plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import RobotError


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """Waypoints to drive through in order, beginning at the robot's position.

    `yaws_rad[i]` is the heading to take up, standing, at waypoint `i` (a viewpoint); NaN = drive on.
    Between waypoints the robot drives straight. `Path.empty()` has no waypoints.
    """

    positions_m: Float[ndarray, "n 2"]
    yaws_rad: Float[ndarray, " n"]

    def __post_init__(self) -> None:
        if self.positions_m.shape != (len(self.yaws_rad), 2):
            raise RobotError(
                f"path has positions {self.positions_m.shape} for {len(self.yaws_rad)} yaws; "
                "expected (n, 2) and (n,)"
            )

    @staticmethod
    def empty() -> Path:
        return Path(positions_m=np.zeros((0, 2)), yaws_rad=np.zeros(0))

    def to_first_view(self) -> Path:
        """The path as far as its first viewpoint, there included; all of it where there is none."""
        views = np.flatnonzero(np.isfinite(self.yaws_rad))
        end = int(views[0]) + 1 if len(views) else len(self.yaws_rad)
        return Path(positions_m=self.positions_m[:end], yaws_rad=self.yaws_rad[:end])

    @property
    def length_m(self) -> float:
        return float(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1).sum())
