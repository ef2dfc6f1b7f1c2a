"""A path with times: where a robot is to be when. Plain arrays, as they are sent to a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from hgs_core.robot.kinematics import wrapped

_STRAIGHT_1PM = 1e-9


@dataclass(frozen=True, kw_only=True)
class PathPose:
    """One moment of a timed path."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    """Negative backwards."""
    curvature_1pm: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TimedPath:
    """Samples in order of time; the speed is linear in time between them.

    `curvature_1pm[i]` is the curvature (left positive) of the motion from sample `i` to the next, along the
    heading. Where it is 0 the motion is straight and the heading linear in time.
    """

    t_s: Float[ndarray, " n"]
    """From 0, never falling: two samples at one time are a jump of the speed."""
    x_m: Float[ndarray, " n"]
    y_m: Float[ndarray, " n"]
    yaw_rad: Float[ndarray, " n"]
    """Continuous: not wrapped."""
    speed_mps: Float[ndarray, " n"]
    """Along the way; negative backwards."""
    curvature_1pm: Float[ndarray, " n"]
    at_waypoint: Int[ndarray, " n_waypoints"]
    """The sample at which each waypoint of the path is reached, its yaw taken up."""

    def with_gears(self, gears: Float[ndarray, " n_segments"]) -> TimedPath:
        """The same path with the segments of gear -1 driven backwards."""
        before, after = np.concatenate([gears[:1], gears]), np.concatenate([gears, gears[-1:]])
        sign = np.where(self.speed_mps == 0.0, 1.0, np.where(before < 0.0, before, after))
        return replace(self, speed_mps=self.speed_mps * sign)

    @property
    def duration_s(self) -> float:
        return float(self.t_s[-1])

    def driven_m(self, t_s: float) -> float:
        """Signed metres along the way until then: backwards counts against."""
        k, _, part = self._part_of_segment(t_s)
        return float(self._driven[k] + part)

    def at(self, t_s: float) -> PathPose:
        """Where to be then; before the beginning and after the end, the first and the last sample."""
        k, tau, part = self._part_of_segment(t_s)
        last = len(self.t_s) - 1
        x, y, yaw = float(self.x_m[k]), float(self.y_m[k]), float(self.yaw_rad[k])
        if k == last:
            return PathPose(x_m=x, y_m=y, yaw_rad=yaw, speed_mps=float(self.speed_mps[k]), curvature_1pm=0.0)
        span = float(self.t_s[k + 1] - self.t_s[k])
        share = tau / span if span > 0.0 else 0.0
        speed = float(self.speed_mps[k] + share * (self.speed_mps[k + 1] - self.speed_mps[k]))
        curvature = float(self.curvature_1pm[k])
        if abs(curvature) > _STRAIGHT_1PM:
            ahead = yaw + curvature * part
            x += (math.sin(ahead) - math.sin(yaw)) / curvature
            y -= (math.cos(ahead) - math.cos(yaw)) / curvature
            yaw = ahead
        else:
            whole = 0.5 * float(self.speed_mps[k] + self.speed_mps[k + 1]) * span
            along = part / whole if whole != 0.0 else 0.0
            x += along * float(self.x_m[k + 1] - self.x_m[k])
            y += along * float(self.y_m[k + 1] - self.y_m[k])
            yaw += share * float(self.yaw_rad[k + 1] - self.yaw_rad[k])
        return PathPose(x_m=x, y_m=y, yaw_rad=yaw, speed_mps=speed, curvature_1pm=curvature)

    def braking_from(self, t_s: float, braking_mps2: float) -> TimedPath:
        """The way on from that time to a stand, losing `braking_mps2` throughout. It has no waypoints."""
        here = self.at(t_s)
        timed = TimedPathBuilder(np.array([here.x_m, here.y_m]), here.yaw_rad, speed_mps=here.speed_mps)
        speed, t = here.speed_mps, t_s
        sign = math.copysign(1.0, speed)
        k = int(np.searchsorted(self.t_s, t_s, side="right"))
        while abs(speed) > 1e-9 and k < len(self.t_s):
            segment = abs(self.driven_m(float(self.t_s[k])) - self.driven_m(t))
            square = speed * speed - 2.0 * braking_mps2 * segment
            curvature = float(self.curvature_1pm[k - 1])
            if square > 0.0 and k < len(self.t_s) - 1:
                slower = sign * math.sqrt(square)
                end = np.array([self.x_m[k], self.y_m[k]])
                yaw = float(self.yaw_rad[k])
            else:
                slower = 0.0
                share = min(1.0, speed * speed / (2.0 * braking_mps2 * segment)) if segment > 0.0 else 1.0
                end, yaw = self._along_segment(t, k, share * segment * sign)
                segment *= share
            duration = 2.0 * segment / abs(speed + slower)
            timed.add(duration, position_m=end, yaw_rad=yaw, speed_mps=slower, curvature_1pm=curvature)
            speed, t, k = slower, float(self.t_s[k]), k + 1
        return timed.built()

    def _along_segment(self, t_s: float, k: int, signed_m: float) -> tuple[Float[ndarray, " 2"], float]:
        """So far on from the pose at `t_s`, within the segment that ends at sample `k`."""
        here = self.at(t_s)
        curvature = float(self.curvature_1pm[k - 1])
        if abs(curvature) > _STRAIGHT_1PM:
            ahead = here.yaw_rad + curvature * signed_m
            x = here.x_m + (math.sin(ahead) - math.sin(here.yaw_rad)) / curvature
            y = here.y_m - (math.cos(ahead) - math.cos(here.yaw_rad)) / curvature
            return np.array([x, y]), ahead
        step = np.array([self.x_m[k] - here.x_m, self.y_m[k] - here.y_m])
        length = float(np.hypot(*step))
        place = np.array([here.x_m, here.y_m])
        return (place + step * (abs(signed_m) / length) if length > 0.0 else place), here.yaw_rad

    def _part_of_segment(self, t_s: float) -> tuple[int, float, float]:
        """The segment that holds a time, the seconds since its beginning and the signed metres since."""
        k = int(np.searchsorted(self.t_s, t_s, side="right")) - 1
        if k < 0:
            return 0, 0.0, 0.0
        if k >= len(self.t_s) - 1:
            return len(self.t_s) - 1, 0.0, 0.0
        tau, span = t_s - float(self.t_s[k]), float(self.t_s[k + 1] - self.t_s[k])
        begin, end = float(self.speed_mps[k]), float(self.speed_mps[k + 1])
        return k, tau, begin * tau + 0.5 * (end - begin) * tau * tau / span

    @cached_property
    def _driven(self) -> Float[ndarray, " n"]:
        parts = 0.5 * (self.speed_mps[:-1] + self.speed_mps[1:]) * np.diff(self.t_s)
        return np.concatenate([[0.0], np.cumsum(parts)])


class TimedPathBuilder:
    """Puts a timed path together, sample after sample."""

    def __init__(self, position_m: Float[ndarray, " 2"], yaw_rad: float, *, speed_mps: float = 0.0) -> None:
        self.position_m = np.asarray(position_m, dtype=np.float64)
        self.yaw_rad = yaw_rad
        self._rows = [(0.0, *self.position_m.tolist(), yaw_rad, speed_mps)]
        self._curvatures: list[float] = []
        self._waypoints: list[int] = []

    def add(
        self,
        duration_s: float,
        *,
        position_m: Float[ndarray, " 2"] | None = None,
        yaw_rad: float | None = None,
        speed_mps: float = 0.0,
        curvature_1pm: float = 0.0,
    ) -> None:
        """A sample so much later; place and yaw (by the shorter way round) stay where they are not given."""
        if position_m is not None:
            self.position_m = np.asarray(position_m, dtype=np.float64)
        if yaw_rad is not None:
            self.yaw_rad += wrapped(yaw_rad - self.yaw_rad)
        t_s = self._rows[-1][0] + duration_s
        self._rows.append((t_s, *self.position_m.tolist(), self.yaw_rad, speed_mps))
        self._curvatures.append(curvature_1pm)

    def reached_waypoint(self) -> None:
        """The path's next waypoint is reached with the last sample."""
        self._waypoints.append(len(self._rows) - 1)

    def built(self) -> TimedPath:
        rows = np.array(self._rows)
        return TimedPath(
            t_s=rows[:, 0],
            x_m=rows[:, 1],
            y_m=rows[:, 2],
            yaw_rad=rows[:, 3],
            speed_mps=rows[:, 4],
            curvature_1pm=np.array([*self._curvatures, 0.0]),
            at_waypoint=np.array(self._waypoints, dtype=np.int64),
        )
