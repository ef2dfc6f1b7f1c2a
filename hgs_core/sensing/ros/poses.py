"""`geometry_msgs/Pose` and `Transform`, and poses between two that are stamped."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import SensorError, StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.raw_frame import nearest_index

POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
ODOMETRY: Final = "nav_msgs/msg/Odometry"


def stamp_s(header: Any) -> float:
    """Time [s] of a `std_msgs/Header`."""
    return float(header.stamp.sec) + 1e-9 * float(header.stamp.nanosec)


def pose(message: Any, where: str) -> SE3:
    """Of a `geometry_msgs/Pose`. Raises `StreamError` for numbers that are not finite, and for a quaternion
    whose norm is not 1."""
    return _rigid(message.position, message.orientation, where)


def transform(message: Any, where: str) -> SE3:
    """Of a `geometry_msgs/Transform`. Raises as `pose`."""
    return _rigid(message.translation, message.rotation, where)


class StampedPoses:
    """A pose that changes with time.

    Between two poses at most `gap_s` apart it moves along one screw; else, and before the first and after the
    last, the nearest pose counts that is at most `offset_s` away.
    """

    def __init__(self, stamped: list[tuple[float, SE3]], *, offset_s: float, gap_s: float) -> None:
        ordered = sorted(stamped, key=lambda pair: pair[0])
        self._times_s: Float[ndarray, " n"] = np.array([time for time, _ in ordered])
        self._poses = [pose for _, pose in ordered]
        self._offset_s = offset_s
        self._gap_s = gap_s

    def at(self, time_s: float) -> SE3 | None:
        """The pose at that time; None where none is near enough."""
        after = int(np.searchsorted(self._times_s, time_s))
        if 0 < after < len(self._times_s):
            before_s, after_s = float(self._times_s[after - 1]), float(self._times_s[after])
            if after_s - before_s <= self._gap_s:
                first, second = self._poses[after - 1], self._poses[after]
                share = (time_s - before_s) / (after_s - before_s)
                return first @ SE3.exp(share * (first.inverse() @ second).log())
        nearest = nearest_index(self._times_s, time_s, self._offset_s)
        return None if nearest is None else self._poses[nearest]


def _rigid(position: Any, orientation: Any, where: str) -> SE3:
    translation = np.array([position.x, position.y, position.z], dtype=float)
    quaternion = np.array([orientation.w, orientation.x, orientation.y, orientation.z], dtype=float)
    if not np.isfinite(translation).all():
        raise StreamError(f"{where}: position {translation.tolist()} is not finite")
    try:
        return SE3.from_quaternion_wxyz(quaternion, translation)
    except SensorError as error:
        raise StreamError(f"{where}: {error}") from error
