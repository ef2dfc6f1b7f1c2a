"""A robot that drives in any direction and turns meanwhile, as on mecanum wheels."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field

from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.robot.speed_profile import speeds_along, times_along
from hgs_core.robot.timed_path import TimedPath, TimedPathBuilder

_SAMPLE_M = 0.05


class HolonomicConfig(RobotConfig):
    """An upright cylinder that turns while it drives."""

    drive: Literal["holonomic"] = "holonomic"
    max_turn_rate_degps: float = Field(60.0, gt=0)
    """Turning rate [degrees/s], at a stand and while driving."""
    max_acceleration_mps2: float = Field(1.0, gt=0)
    """Greatest gain of speed [m/s^2]."""
    max_braking_mps2: float = Field(1.5, gt=0)
    """Greatest loss of speed [m/s^2]."""
    corner_change_mps: float = Field(0.2, gt=0)
    """How much the velocity may change at once where the path has a corner [m/s]: sharper corners are
    driven through more slowly."""


class Holonomic:
    """Implements `Vehicle`."""

    def __init__(self, config: HolonomicConfig) -> None:
        self.config = config

    def first_look(self, state: RobotState) -> Path:
        return Path.full_turn(state.x_m, state.y_m, state.yaw_rad)

    def timed(self, path: Path, yaw_rad: float) -> TimedPath:
        """See `Vehicle`. From one view to the next it turns, by the shorter way round, while it drives."""
        timed = TimedPathBuilder(path.positions_m[0], yaw_rad)
        ends = [*np.flatnonzero(np.isfinite(path.yaws_rad)).tolist(), len(path.yaws_rad) - 1]
        first = 0
        for end in dict.fromkeys(ends):
            self._add_leg(timed, path.positions_m[first : end + 1], float(path.yaws_rad[end]), first == 0)
            first = end
        return timed.built()

    def _add_leg(
        self, timed: TimedPathBuilder, corners_m: Float[ndarray, "n 2"], yaw_rad: float, is_first: bool
    ) -> None:
        """Along the corners to a stand at the last of them, where `yaw_rad` (NaN: none) is taken up."""
        rate = np.radians(self.config.max_turn_rate_degps)
        points, is_corner = _sampled(corners_m)
        lengths = np.hypot(*np.diff(points, axis=0).T)
        speeds = speeds_along(
            lengths,
            self._speed_limits(points),
            acceleration_mps2=self.config.max_acceleration_mps2,
            braking_mps2=self.config.max_braking_mps2,
        )
        turn = 0.0 if np.isnan(yaw_rad) else wrapped(yaw_rad - timed.yaw_rad)
        began = timed.yaw_rad
        elapsed = np.concatenate([[0.0], np.cumsum(times_along(lengths, speeds))])

        def yaw_at(seconds: float) -> float:
            return began + float(np.sign(turn)) * min(abs(turn), rate * seconds)

        if is_first:
            timed.reached_waypoint()
        done_s = abs(turn) / rate
        for k in range(1, len(points)):
            timed.add(
                float(elapsed[k] - elapsed[k - 1]),
                position_m=points[k],
                yaw_rad=yaw_at(float(elapsed[k])),
                speed_mps=float(speeds[k]),
            )
            if is_corner[k] and k < len(points) - 1:
                timed.reached_waypoint()
        if done_s > elapsed[-1]:
            timed.add(float(done_s - elapsed[-1]), yaw_rad=began + turn)
        if len(corners_m) > 1:
            timed.reached_waypoint()

    def _speed_limits(self, points_m: Float[ndarray, "n 2"]) -> Float[ndarray, " n"]:
        """At a corner of angle a, a velocity of speed v changes by 2 v sin(a / 2)."""
        limits = np.full(len(points_m), self.config.max_speed_mps)
        steps = np.diff(points_m, axis=0)
        headings = np.arctan2(steps[:, 1], steps[:, 0])
        turned = np.abs(np.remainder(np.diff(headings) + np.pi, 2 * np.pi) - np.pi)
        change = 2.0 * np.sin(turned / 2.0)
        limits[1:-1] = np.minimum(limits[1:-1], self.config.corner_change_mps / np.maximum(change, 1e-9))
        limits[[0, -1]] = 0.0
        return limits


def _sampled(corners_m: Float[ndarray, "n 2"]) -> tuple[Float[ndarray, "m 2"], list[bool]]:
    """The corners with points between them, and which are corners; a straight has at least one between."""
    points, is_corner = [corners_m[0]], [True]
    for before, corner in pairwise(corners_m):
        n = max(2, int(np.ceil(np.hypot(*(corner - before)) / _SAMPLE_M)))
        if np.all(corner == before):
            n = 1
        for k in range(1, n + 1):
            points.append(before + (corner - before) * k / n)
            is_corner.append(k == n)
    return np.array(points), is_corner
