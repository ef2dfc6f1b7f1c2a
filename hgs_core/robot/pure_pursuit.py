"""Regulated pure pursuit for a robot on two driven wheels.

Pure pursuit (Coulter, "Implementation of the Pure Pursuit Path Tracking Algorithm", 1992) steers along the
arc through a point of the path a little ahead: a point at distance `d` and bearing `a` lies on the arc of
curvature `2 sin(a) / d`. Regulated (Macenski et al., "Regulated Pure Pursuit for Robot Path Tracking", 2023):
the speed falls with the curvature and towards the path's end.

Where the path bends sharply, and where a view is to be taken up, the robot stands and turns on the spot: it
cuts no corner that the path's clearance was not planned for. A bend of angle `b` that is driven through is
cut by about `lookahead / 4 * sin(b)`.
"""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.robot.differential import DifferentialConfig
from hgs_core.robot.kinematics import wrapped
from hgs_core.robot.motion import STILL, GroundPose, Twist
from hgs_core.robot.path import Path

ACCELERATION_MPS2: Final = 1.0
BRAKING_MPS2: Final = 1.5
TURN_ACCELERATION_RADPS2: Final = 4.0
_LOOKAHEAD_S: Final = 0.35
_LOOKAHEAD_M: Final = (0.15, 0.35)
"""Least and greatest; between them it is what is driven in `_LOOKAHEAD_S`."""
_BEND_RAD: Final = math.radians(10.0)
"""Sharper bends are turned through on the spot."""
_ALIGNED_RAD: Final = math.radians(1.5)
"""How well it heads for the path before it drives."""
_LOST_RAD: Final = math.radians(60.0)
"""With the path's point at a greater bearing it stands and turns to it."""
_TAKEN_UP_RAD: Final = math.radians(0.4)
_REACHED_M: Final = 0.005
_HERE_M: Final = 0.03
_FIRST_WAYPOINT_M: Final = 0.05
"""The first waypoint is the robot's own position: within so much it does not move to it."""
_CREEP_MPS: Final = 0.03
_PROFILE: Final = 0.8
"""Share of the brakes that planned slowing down uses: the rest is for keeping to it."""


class _Phase(Enum):
    ALIGN = auto()
    DRIVE = auto()
    LOOK = auto()


class PurePursuit:
    """Implements `PathTracker`. Accelerates and brakes, though planners take it to have its speed at once."""

    def __init__(
        self, config: DifferentialConfig, path: Path, pose: GroundPose, max_speed_mps: float
    ) -> None:
        self._turn_radps = math.radians(config.max_turn_rate_degps)
        self._max_speed_mps = min(max_speed_mps, config.max_speed_mps)
        self._path = path
        self._passed = 0
        self._speed_mps = 0.0
        self._turning_radps = 0.0
        self._braking = False
        self._leg: _Leg | None = None
        self._phase = _Phase.ALIGN
        self._next_leg(pose)

    @property
    def waypoints_passed(self) -> int:
        return self._passed

    @property
    def arrived(self) -> bool:
        return self._braking or self._leg is None

    @property
    def standing(self) -> bool:
        return self.arrived and self._speed_mps == 0.0 and self._turning_radps == 0.0

    @property
    def standing_in_s(self) -> float:
        return max(self._speed_mps / BRAKING_MPS2, abs(self._turning_radps) / TURN_ACCELERATION_RADPS2)

    def brake(self) -> None:
        self._braking = True

    def limit_speed(self, max_speed_mps: float) -> None:
        self._max_speed_mps = max_speed_mps

    def twist(self, pose: GroundPose, duration_s: float) -> Twist:
        if self.arrived:
            return self._slowing(pose, duration_s)
        assert self._leg is not None
        if self._phase is _Phase.ALIGN:
            aim = self._leg.bearing_rad(pose, _LOOKAHEAD_M[1])
            if not self._turned_by(aim, _ALIGNED_RAD, duration_s):
                return Twist(turn_radps=self._turning_radps)
            self._phase = _Phase.DRIVE
        if self._phase is _Phase.DRIVE:
            if not self._driven(self._leg, pose, duration_s):
                return Twist(forward_mps=self._speed_mps, turn_radps=self._turning_radps)
            self._phase = _Phase.LOOK
        yaw = float(self._path.yaws_rad[self._leg.end])
        if not math.isnan(yaw) and not self._turned_by(
            wrapped(yaw - pose.yaw_rad), _TAKEN_UP_RAD, duration_s
        ):
            return Twist(turn_radps=self._turning_radps)
        self._passed = self._leg.end + 1
        self._next_leg(pose)
        return STILL

    def _next_leg(self, pose: GroundPose) -> None:
        if self._passed >= len(self._path.yaws_rad):
            self._leg = None
            return
        self._leg = _Leg.along(self._path, self._passed, pose)
        self._phase = _Phase.ALIGN if self._leg.is_way else _Phase.LOOK

    def _driven(self, leg: _Leg, pose: GroundPose, duration_s: float) -> bool:
        """Sets the speeds for the next tick; True when the leg's end is reached, and the robot stands."""
        left_m = leg.advance(pose)
        while self._passed < leg.end and leg.driven_m >= leg.at_waypoint_m(self._passed):
            self._passed += 1
        if left_m <= _REACHED_M:
            self._speed_mps = self._turning_radps = 0.0
            return True
        ahead_m = min(max(_LOOKAHEAD_S * self._speed_mps, _LOOKAHEAD_M[0]), _LOOKAHEAD_M[1])
        bearing = leg.bearing_rad(pose, ahead_m)
        if abs(bearing) > _LOST_RAD:
            self._accelerate(0.0, duration_s)
            if self._speed_mps == 0.0:
                self._phase, self._turning_radps = _Phase.ALIGN, 0.0
            return False
        curvature = 2.0 * math.sin(bearing) / leg.distance_m(pose, ahead_m)
        wanted = min(self._max_speed_mps, math.sqrt(2.0 * _PROFILE * BRAKING_MPS2 * left_m))
        if abs(curvature) > 1e-6:
            wanted = min(wanted, self._turn_radps / abs(curvature))
        self._accelerate(max(wanted, _CREEP_MPS), duration_s)
        self._turning_radps = self._within_turn_rate(curvature * self._speed_mps)
        return False

    def _within_turn_rate(self, rate_radps: float) -> float:
        return min(max(rate_radps, -self._turn_radps), self._turn_radps)

    def _accelerate(self, wanted_mps: float, duration_s: float) -> None:
        least = self._speed_mps - BRAKING_MPS2 * duration_s
        most = self._speed_mps + ACCELERATION_MPS2 * duration_s
        self._speed_mps = max(min(max(wanted_mps, least), most), 0.0)

    def _turned_by(self, angle_rad: float, tolerance_rad: float, duration_s: float) -> bool:
        """Sets the turning rate for the next tick; True when nothing is left to turn, and the robot
        stands."""
        if abs(angle_rad) <= tolerance_rad:
            self._turning_radps = 0.0
            return True
        rate = min(
            self._turn_radps,
            math.sqrt(2.0 * _PROFILE * TURN_ACCELERATION_RADPS2 * abs(angle_rad)),
            abs(angle_rad) / duration_s,
        )
        most = abs(self._turning_radps) + TURN_ACCELERATION_RADPS2 * duration_s
        if self._turning_radps * angle_rad < 0.0:
            most = TURN_ACCELERATION_RADPS2 * duration_s
        self._turning_radps = math.copysign(min(rate, most), angle_rad)
        return False

    def _slowing(self, pose: GroundPose, duration_s: float) -> Twist:
        """On along the path to a stand."""
        before = self._speed_mps
        self._accelerate(0.0, duration_s)
        if self._speed_mps > 0.0 and before > 0.0:
            self._turning_radps *= self._speed_mps / before
            if self._leg is not None:
                self._leg.advance(pose)
                bearing = self._leg.bearing_rad(pose, _LOOKAHEAD_M[0])
                if abs(bearing) <= _LOST_RAD:
                    curvature = 2.0 * math.sin(bearing) / self._leg.distance_m(pose, _LOOKAHEAD_M[0])
                    self._turning_radps = self._within_turn_rate(curvature * self._speed_mps)
        else:
            slower = max(abs(self._turning_radps) - TURN_ACCELERATION_RADPS2 * duration_s, 0.0)
            self._turning_radps = math.copysign(slower, self._turning_radps) if slower else 0.0
        return Twist(forward_mps=self._speed_mps, turn_radps=self._turning_radps)


class _Leg:
    """The part of a path from a stand to the next one, and how far along it the robot is."""

    def __init__(self, points_m: Float[ndarray, "n 2"], first: int, end: int) -> None:
        self.end = end
        """Index of the waypoint where it ends."""
        self.driven_m = 0.0
        self._first = first
        """Index of the waypoint that the second point is."""
        self._points = points_m
        steps = np.diff(points_m, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        self._arc = np.concatenate([[0.0], np.cumsum(lengths)])
        self._directions = steps / np.maximum(lengths, 1e-12)[:, None]

    @staticmethod
    def along(path: Path, first: int, pose: GroundPose) -> _Leg:
        """From where the robot stands to the next waypoint at which it has to stand."""
        here = np.array([pose.x_m, pose.y_m])
        begin = here if first == 0 else path.positions_m[first - 1]
        near = _FIRST_WAYPOINT_M if first == 0 else _HERE_M
        n = len(path.yaws_rad)
        points, end = [begin, path.positions_m[first]], first
        if np.hypot(*(path.positions_m[first] - here)) <= near:
            # Already there: it is passed on the spot, whatever lies behind.
            return _Leg(np.array([here, here]), first, end)
        while end + 1 < n and math.isnan(path.yaws_rad[end]):
            step, following = points[-1] - points[-2], path.positions_m[end + 1] - points[-1]
            if np.hypot(*step) > 0.0 and np.hypot(*following) > 0.0:
                bend = wrapped(math.atan2(following[1], following[0]) - math.atan2(step[1], step[0]))
                if abs(bend) > _BEND_RAD:
                    break
            points.append(path.positions_m[end + 1])
            end += 1
        return _Leg(np.array(points), first, end)

    @property
    def is_way(self) -> bool:
        return float(self._arc[-1]) > 0.0

    def at_waypoint_m(self, index: int) -> float:
        """How far along the leg a waypoint of the path lies."""
        return float(self._arc[index - self._first + 1])

    def advance(self, pose: GroundPose) -> float:
        """Moves on to the leg's point nearest to the robot, never back; the metres that are left."""
        here = np.array([pose.x_m, pose.y_m])
        k = int(np.searchsorted(self._arc, self.driven_m, side="right")) - 1
        best = (np.inf, self.driven_m)
        for j in range(max(k, 0), min(k + 3, len(self._directions))):
            length = float(self._arc[j + 1] - self._arc[j])
            along = min(max(float((here - self._points[j]) @ self._directions[j]), 0.0), length)
            foot = self._points[j] + along * self._directions[j]
            best = min(best, (float(np.hypot(*(here - foot))), float(self._arc[j]) + along))
        self.driven_m = max(self.driven_m, best[1])
        return float(self._arc[-1]) - self.driven_m

    def bearing_rad(self, pose: GroundPose, ahead_m: float) -> float:
        """To the point so far ahead along the leg, from the robot's heading."""
        x, y = self._ahead(ahead_m) - [pose.x_m, pose.y_m]
        return wrapped(math.atan2(y, x) - pose.yaw_rad)

    def distance_m(self, pose: GroundPose, ahead_m: float) -> float:
        return max(float(np.hypot(*(self._ahead(ahead_m) - [pose.x_m, pose.y_m]))), 1e-3)

    def _ahead(self, ahead_m: float) -> Float[ndarray, " 2"]:
        """So far on along the leg; beyond its end, straight on: steering stays well-posed to the last."""
        at = self.driven_m + ahead_m
        k = min(int(np.searchsorted(self._arc, at, side="right")) - 1, len(self._directions) - 1)
        point: Float[ndarray, " 2"] = self._points[k] + (at - self._arc[k]) * self._directions[k]
        return point
