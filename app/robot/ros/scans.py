"""Planar scans as they travel, from `sensor_msgs/LaserScan`."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.messages import ScanPart

_LEVEL: Final = 0.99
"""Cosine of how far a scanner may be tilted: eight degrees."""


def is_level(T_place_laser: SE3) -> bool:
    """Whether the scanner's plane is (nearly) that of its place, the right way up or upside down."""
    return bool(abs(T_place_laser.rotation[2, 2]) >= _LEVEL)


def scan_part(message: Any, T_world_laser: SE3, where: str) -> ScanPart:
    """Of a `sensor_msgs/LaserScan` that lies level, the right way up or upside down.

    rosbridge writes what is not finite as null: such a ray may have met nothing, or not have come back, and
    counts as the latter. Raises `StreamError` for angles that are none, and a scanner that is tilted.
    """
    ranges = np.array([np.nan if value is None else value for value in message.ranges], dtype=np.float32)
    known = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
    if not is_level(T_world_laser):
        raise StreamError(f"{where}: the scanner is tilted")
    ahead = T_world_laser.rotation[:, 0]
    side = float(np.sign(T_world_laser.rotation[2, 2]))  # -1: upside down
    return ScanPart(
        origin_m=T_world_laser.translation.tolist(),
        first_bearing_rad=math.atan2(ahead[1], ahead[0]) + side * float(message.angle_min),
        step_rad=side * float(message.angle_increment),
        ranges_m=np.where(known, ranges, np.float32(0.0)).astype("<f4").tobytes(),
    )
