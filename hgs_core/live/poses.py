"""Poses as they travel: 16 numbers, row by row."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hgs_core.errors import SensorError, StreamError
from hgs_core.geometry.se3 import SE3

FARTHEST_M: Final = 10_000.0
"""A pose farther from its origin than this is no pose."""


def pose_of(numbers: list[float], where: str) -> SE3:
    """The rigid transform. Raises `StreamError` for what is none."""
    if len(numbers) != 16 or not all(math.isfinite(number) for number in numbers):
        raise StreamError(f"{where}: a pose has 16 finite numbers, row by row")
    try:
        pose = SE3.from_matrix(np.array(numbers, dtype=np.float64).reshape(4, 4))
    except SensorError as error:
        raise StreamError(f"{where}: {error}") from error
    if np.abs(pose.translation).max() > FARTHEST_M:
        raise StreamError(f"{where}: the pose lies {np.abs(pose.translation).max():.0f} m from the origin")
    return pose


def numbers_of(pose: SE3) -> list[float]:
    """What `pose_of` reads."""
    return pose.as_matrix().reshape(-1).tolist()
