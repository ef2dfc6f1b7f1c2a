"""A car: two steered wheels in front, two fixed ones behind, on whose axle its reference point lies.

Without slip the axle's middle moves along the heading, and the heading turns by the curvature times what is
driven: `tan(steering angle) / wheelbase`, at most `1 / min_turning_radius_m`.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import Field, model_validator

from hgs_core.errors import RobotError
from hgs_core.robot.path import Path
from hgs_core.robot.robot import RobotConfig, RobotState
from hgs_core.robot.speed_profile import speeds_along, times_along
from hgs_core.robot.timed_path import TimedPath, TimedPathBuilder

_SAME_PLACE_M = 1e-6


class AckermannConfig(RobotConfig):
    """A car with a rectangular footprint; camera and scanner stand above the middle of its rear axle."""

    drive: Literal["ackermann"] = "ackermann"
    wheelbase_m: float = Field(0.28, gt=0)
    """From the rear axle to the front axle [m]."""
    max_steering_deg: float = Field(35.0, gt=0, lt=80)
    """Greatest steering angle, of a wheel in the middle of the front axle [degrees]."""
    rear_overhang_m: float = Field(0.10, ge=0)
    """How far the body reaches behind the rear axle [m]."""
    front_overhang_m: float = Field(0.10, ge=0)
    """How far it reaches ahead of the front axle [m]."""
    width_m: float = Field(0.36, gt=0)
    """Width of the body [m]."""
    max_reverse_speed_mps: float = Field(0.5, gt=0)
    """Driving speed backwards [m/s]."""
    max_acceleration_mps2: float = Field(1.0, gt=0)
    """Greatest gain of speed [m/s^2]."""
    max_braking_mps2: float = Field(1.5, gt=0)
    """Greatest loss of speed [m/s^2]."""
    max_lateral_acceleration_mps2: float = Field(1.0, gt=0)
    """Curves are driven through no faster than this allows [m/s^2]."""
    steering_reserve: float = Field(0.05, ge=0, lt=1)
    """Paths are planned for a turning radius greater by this share: what is left is for keeping to them."""

    @model_validator(mode="after")
    def _disc_covers_width(self) -> AckermannConfig:
        if self.radius_m < self.width_m / 2:
            raise ValueError(f"radius_m {self.radius_m} is less than half of width_m {self.width_m}")
        return self

    @property
    def min_turning_radius_m(self) -> float:
        """Of the middle of the rear axle [m]."""
        return self.wheelbase_m / math.tan(math.radians(self.max_steering_deg))

    @property
    def planned_radius_m(self) -> float:
        """The tightest turn of a planned path [m]."""
        return self.min_turning_radius_m * (1.0 + self.steering_reserve)

    @property
    def front_m(self) -> float:
        """How far the body reaches ahead of the rear axle [m]."""
        return self.wheelbase_m + self.front_overhang_m


class Ackermann:
    """Implements `Vehicle`."""

    def __init__(self, config: AckermannConfig) -> None:
        self.config = config

    def first_look(self, state: RobotState) -> Path:
        """None: it can turn only where there is room, which it has to see first."""
        return Path.empty()

    def timed(self, path: Path, yaw_rad: float) -> TimedPath:
        """See `Vehicle`. It stands where it changes gear and at views."""
        if path.headings_rad is None:
            raise RobotError("a car needs the heading at every waypoint: the path has places alone")
        gears, lengths, curvatures = driven_arcs(path.positions_m, path.headings_rad)
        speeds = speeds_along(
            lengths,
            self._speed_limits(path, gears, curvatures),
            acceleration_mps2=self.config.max_acceleration_mps2,
            braking_mps2=self.config.max_braking_mps2,
        )
        stuck = np.flatnonzero((lengths > 0.0) & (speeds[:-1] + speeds[1:] == 0.0))
        if len(stuck):
            raise RobotError(
                f"the car stands at both ends of segment {stuck[0]}: a path needs a waypoint between"
            )
        times = times_along(lengths, speeds)
        timed = TimedPathBuilder(path.positions_m[0], float(path.headings_rad[0]))
        timed.reached_waypoint()
        for k, duration in enumerate(times.tolist()):
            timed.add(
                duration,
                position_m=path.positions_m[k + 1],
                yaw_rad=float(path.headings_rad[k + 1]),
                speed_mps=float(speeds[k + 1]),
                curvature_1pm=float(curvatures[k]),
            )
            timed.reached_waypoint()
        return timed.built().with_gears(gears)

    def _speed_limits(
        self, path: Path, gears: Float[ndarray, " n_segments"], curvatures_1pm: Float[ndarray, " n_segments"]
    ) -> Float[ndarray, " n"]:
        config = self.config
        straight = np.where(gears < 0.0, config.max_reverse_speed_mps, config.max_speed_mps)
        curve = np.sqrt(config.max_lateral_acceleration_mps2 / np.maximum(np.abs(curvatures_1pm), 1e-9))
        segments = np.minimum(straight, curve)
        limits = np.zeros(len(path.yaws_rad))
        limits[1:-1] = np.minimum(segments[:-1], segments[1:])
        limits[1:-1][gears[:-1] != gears[1:]] = 0.0
        limits[np.isfinite(path.yaws_rad)] = 0.0
        return limits


def driven_arcs(
    positions_m: Float[ndarray, "n 2"], headings_rad: Float[ndarray, " n"]
) -> tuple[Float[ndarray, " m"], Float[ndarray, " m"], Float[ndarray, " m"]]:
    """Gear (+1, -1), length [m] and curvature [1/m] of the arcs between the waypoints of a car's path."""
    steps = np.diff(positions_m, axis=0)
    turned = np.remainder(np.diff(headings_rad) + np.pi, 2 * np.pi) - np.pi
    middle = headings_rad[:-1] + 0.5 * turned
    along = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    gears = np.where(along < 0.0, -1.0, 1.0)
    chords = np.hypot(steps[:, 0], steps[:, 1])
    lengths = chords / np.sinc(0.5 * turned / np.pi)  # an arc of angle a: chord a/2 / sin(a/2)
    still = chords <= _SAME_PLACE_M
    lengths[still] = 0.0
    curvatures = np.where(still, 0.0, gears * turned / np.maximum(lengths, _SAME_PLACE_M))
    for k in np.flatnonzero(still).tolist():  # a waypoint doubled for a second view: no change of gear
        gears[k] = gears[k - 1] if k else 1.0
    return gears, lengths, curvatures
