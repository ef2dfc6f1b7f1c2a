"""Keeping a car or a holonomic robot to its timed path although its wheels slip.

The reference moves along the timed path and waits where the robot falls behind. Along the way the speed is
the reference's, corrected by `lag / 0.25 s`; across it a car steers as `steered_curvature` says, and a
holonomic robot drives towards the reference likewise.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.holonomic import HolonomicConfig
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.motion import STILL, GroundPose, Twist
from hgs_core.robot.path import Path
from hgs_core.robot.timed_path import PathPose
from hgs_core.robot.tracking import steered_curvature
from hgs_core.robot.vehicle import vehicle_of

_CORRECTION_1PS: Final = 4.0
_WAITS_FROM_M: Final = 0.10
"""Behind by this much the reference slows down; by `_WAITS_AT_M` it stands."""
_WAITS_AT_M: Final = 0.25
_REACHED_M: Final = 0.01
_TAKEN_UP_RAD: Final = math.radians(0.5)
_PATIENCE_S: Final = 2.0
"""So long after the reference's end the robot may take to reach it."""
_STEERING_SHIFT_S: Final = 0.15


class TimedTracker:
    """Implements `PathTracker`."""

    def __init__(
        self, config: AckermannConfig | HolonomicConfig, path: Path, pose: GroundPose, max_speed_mps: float
    ) -> None:
        limited: dict[str, float] = {"max_speed_mps": min(max_speed_mps, config.max_speed_mps)}
        if isinstance(config, AckermannConfig):
            limited["max_reverse_speed_mps"] = min(config.max_reverse_speed_mps, max_speed_mps)
        self._config = config.model_copy(update=limited)
        self._timed = vehicle_of(self._config).timed(path, pose.yaw_rad)
        self._reference_s = 0.0
        self._waited_s = 0.0
        self._passed = 0
        self._braking = False
        self._done = False

    @property
    def waypoints_passed(self) -> int:
        return self._passed

    @property
    def arrived(self) -> bool:
        return self._braking or self._done

    @property
    def standing(self) -> bool:
        return self._done

    @property
    def standing_in_s(self) -> float:
        if self._done:
            return 0.0
        if self._braking:
            return max(self._timed.duration_s - self._reference_s, 0.0)
        return self._timed.braking_from(self._reference_s, self._config.max_braking_mps2).duration_s

    def brake(self) -> None:
        if self.arrived:
            return
        self._timed = self._timed.braking_from(self._reference_s, self._config.max_braking_mps2)
        self._reference_s, self._braking = 0.0, True
        self._done = self._timed.duration_s <= 0.0

    def limit_speed(self, max_speed_mps: float) -> None:
        """Driving faster than that, it brakes to a stand: the next path keeps to the limit."""
        if abs(self._timed.at(self._reference_s).speed_mps) > max_speed_mps:
            self.brake()

    def twist(self, pose: GroundPose, duration_s: float) -> Twist:
        if self._done:
            return STILL
        reference = self._timed.at(self._reference_s)
        offset = GroundPose(x_m=reference.x_m, y_m=reference.y_m, yaw_rad=reference.yaw_rad).seen_from(pose)
        gear = -1.0 if self._timed.at(self._reference_s + 0.5 * duration_s).speed_mps < 0.0 else 1.0
        lag_m = self._lag_m(reference, pose, gear)
        if self._reference_s >= self._timed.duration_s:
            self._waited_s += duration_s
            if self._is_reached(offset, lag_m) or self._waited_s >= _PATIENCE_S:
                self._done = True
                if not self._braking:
                    self._passed = len(self._timed.at_waypoint)
                return STILL
        before_s = self._reference_s
        rate = min(max((_WAITS_AT_M - lag_m) / (_WAITS_AT_M - _WAITS_FROM_M), 0.0), 1.0)
        self._reference_s = min(before_s + rate * duration_s, self._timed.duration_s)
        if not self._braking:
            reached = self._timed.t_s[self._timed.at_waypoint] <= self._reference_s + 1e-9
            # The last waypoint counts when the robot, not the reference, is there.
            self._passed = min(int(np.count_nonzero(reached)), len(reached) - 1)
        if isinstance(self._config, AckermannConfig):
            return self._car_twist(self._config, pose, gear, lag_m, before_s, duration_s)
        return self._holonomic_twist(self._config, pose, offset, before_s, duration_s)

    def _lag_m(self, reference: PathPose, pose: GroundPose, gear: float) -> float:
        """How far the robot is behind: along the heading for a car, any way for others."""
        dx, dy = reference.x_m - pose.x_m, reference.y_m - pose.y_m
        if not isinstance(self._config, AckermannConfig):
            return math.hypot(dx, dy)
        return gear * (math.cos(reference.yaw_rad) * dx + math.sin(reference.yaw_rad) * dy)

    def _is_reached(self, offset: GroundPose, lag_m: float) -> bool:
        if isinstance(self._config, AckermannConfig):
            return lag_m <= _REACHED_M
        return lag_m <= _REACHED_M and abs(offset.yaw_rad) <= _TAKEN_UP_RAD

    def _car_twist(
        self,
        config: AckermannConfig,
        pose: GroundPose,
        gear: float,
        lag_m: float,
        now_s: float,
        duration_s: float,
    ) -> Twist:
        wanted_mps = abs(self._timed.at(now_s + 0.5 * duration_s).speed_mps)
        most = config.max_reverse_speed_mps if gear < 0.0 else config.max_speed_mps
        speed = gear * min(max(wanted_mps + _CORRECTION_1PS * lag_m, 0.0), most)
        # Steer by the part of the path where the car is, not where it should be.
        shift_s = min(max(lag_m / max(wanted_mps, 0.2), -_STEERING_SHIFT_S), _STEERING_SHIFT_S)
        there = self._timed.at(now_s - shift_s)
        if there.speed_mps * gear < 0.0:
            there = self._timed.at(now_s)
        curvature = steered_curvature(
            pose.x_m,
            pose.y_m,
            pose.yaw_rad,
            there,
            reversing=gear < 0.0,
            limit_1pm=1.0 / config.min_turning_radius_m,
        )
        return Twist(forward_mps=speed, turn_radps=curvature * speed)

    def _holonomic_twist(
        self,
        config: HolonomicConfig,
        pose: GroundPose,
        offset: GroundPose,
        now_s: float,
        duration_s: float,
    ) -> Twist:
        here, ahead = self._timed.at(now_s), self._timed.at(self._reference_s)
        vx, vy = (ahead.x_m - here.x_m) / duration_s, (ahead.y_m - here.y_m) / duration_s
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        forward = cos * vx + sin * vy + _CORRECTION_1PS * offset.x_m
        left = cos * vy - sin * vx + _CORRECTION_1PS * offset.y_m
        fast = math.hypot(forward, left) / config.max_speed_mps
        if fast > 1.0:
            forward, left = forward / fast, left / fast
        limit = math.radians(config.max_turn_rate_degps)
        turn = wrapped(ahead.yaw_rad - here.yaw_rad) / duration_s + _CORRECTION_1PS * offset.yaw_rad
        return Twist(forward_mps=forward, left_mps=left, turn_radps=min(max(turn, -limit), limit))
