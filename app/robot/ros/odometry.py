"""`OdometryTrack`: where the robot says that it is, and was a moment ago."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Any, Final

from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.robot.motion import GroundPose, Twist, moved
from hgs_core.sensing.ros.poses import StampedPoses, pose, stamp_s

_KEPT: Final = 500
_STEP_M: Final = 0.002
"""What an odometry trembles by is no way driven."""
_BACK_S: Final = 1.0
_CLOCKS_DRIFT: Final = 1e-4
"""So much two clocks may drift apart [s a second] without one's messages seeming late."""
_STALE_S: Final = 0.5
"""Nothing was heard for so long, or what is heard is so old: nobody knows where the robot is."""


@dataclass(frozen=True, kw_only=True)
class OdometryMoment:
    """One message, and the way driven until then."""

    stamp_s: float
    """By the robot's clock."""
    received_s: float
    """By this program's."""
    T_world_base: SE3
    at: GroundPose
    twist: Twist
    path_length_m: float
    world_frame: str
    base_frame: str


class OdometryTrack:
    """One thread adds, others read. Without any message yet, `newest` is None."""

    def __init__(self, *, offset_s: float, gap_s: float) -> None:
        """`offset_s`, `gap_s`: see `StampedPoses`."""
        self._limits = offset_s, gap_s
        self._lock = threading.Lock()
        self._kept: deque[OdometryMoment] = deque(maxlen=_KEPT)
        self._length_from: GroundPose | None = None
        self._least_s = math.inf
        """Least of (time of receipt - stamp): that of a message which came without delay."""

    def stale(self, now_s: float) -> bool:
        """Whether nothing is known of where the robot is now."""
        newest = self.newest
        return newest is None or now_s - newest.received_s > _STALE_S or self.age_s(now_s) > _STALE_S

    def age_s(self, now_s: float) -> float:
        """Of the newest message, beyond the least delay there was. A message that waited behind others is
        old though it has just come."""
        newest = self.newest
        return math.inf if newest is None else max(now_s - newest.stamp_s - self._least_s, 0.0)

    def pose_now(self, now_s: float) -> GroundPose | None:
        """Where the robot will have come to since the newest message."""
        newest = self.newest
        if newest is None:
            return None
        return moved(newest.at, newest.twist, min(self.age_s(now_s), _STALE_S))

    @property
    def newest(self) -> OdometryMoment | None:
        kept = self._kept
        return kept[-1] if kept else None

    def add(self, message: Any, where: str, received_s: float) -> None:
        """An Odometry message; one that is older than the newest is left out. Raises `StreamError` for
        numbers that are no pose, and `ClockSetBack`."""
        stamp = stamp_s(message.header)
        T_world_base = pose(message.pose.pose, where)
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        twist = Twist(forward_mps=float(linear.x), left_mps=float(linear.y), turn_radps=float(angular.z))
        if not all(map(math.isfinite, (stamp, twist.forward_mps, twist.left_mps, twist.turn_radps))):
            raise StreamError(f"{where}: its time or velocities are not finite")
        rotation, (x, y, _) = T_world_base.rotation, T_world_base.translation
        at = GroundPose(x_m=float(x), y_m=float(y), yaw_rad=math.atan2(rotation[1, 0], rotation[0, 0]))
        if stamp <= 0.0:
            raise StreamError(f"{where}: it is not stamped")
        before = self.newest
        if before is not None and stamp <= before.stamp_s:
            if before.stamp_s - stamp > _BACK_S:
                raise ClockSetBack(
                    f"{where}: the robot's clock went back from {before.stamp_s:.2f} s to {stamp:.2f} s"
                )
            return
        passed_s = 0.0 if before is None else received_s - before.received_s
        self._least_s = min(self._least_s + _CLOCKS_DRIFT * passed_s, received_s - stamp)
        moment = OdometryMoment(
            stamp_s=stamp,
            received_s=received_s,
            T_world_base=T_world_base,
            at=at,
            twist=twist,
            path_length_m=self._length_m(at, 0.0 if before is None else before.path_length_m),
            world_frame=str(message.header.frame_id),
            base_frame=str(message.child_frame_id),
        )
        with self._lock:
            self._kept.append(moment)

    def pose_at(self, stamp_s: float) -> SE3 | None:
        """`T_world_base` at that time of the robot's; None where nothing near enough is known of it."""
        offset_s, gap_s = self._limits
        with self._lock:
            stamped = [(one.stamp_s, one.T_world_base) for one in self._kept]
        return StampedPoses(stamped, offset_s=offset_s, gap_s=gap_s).at(stamp_s) if stamped else None

    def _length_m(self, at: GroundPose, length_m: float) -> float:
        if self._length_from is None:
            self._length_from = at
        step = math.hypot(at.x_m - self._length_from.x_m, at.y_m - self._length_from.y_m)
        if step < _STEP_M:
            return length_m
        self._length_from = at
        return length_m + step


class ClockSetBack(StreamError):
    """Nothing that was said before fits to what is said now."""
