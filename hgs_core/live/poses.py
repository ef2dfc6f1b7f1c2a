"""Poses as they travel: 16 numbers, row by row."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3

FARTHEST_M: Final = 10_000.0
"""A pose farther from its origin than this is no pose."""
RIGID_TOLERANCE: Final = 1e-3
"""By how much entries of a rotation times its transpose may differ from the identity's."""


def pose_of(numbers: list[float], where: str) -> SE3:
    """The rigid transform. Raises `StreamError` for what is none."""
    if len(numbers) != 16 or not all(math.isfinite(number) for number in numbers):
        raise StreamError(f"{where}: a pose has 16 finite numbers, row by row")
    matrix = np.array(numbers, dtype=np.float64).reshape(4, 4)
    rotation, translation = matrix[:3, :3], matrix[:3, 3]
    off = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if off > RIGID_TOLERANCE or np.linalg.det(rotation) < 0 or not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise StreamError(f"{where}: the pose is not rigid (off by {off:.2g})")
    if np.abs(translation).max() > FARTHEST_M:
        raise StreamError(f"{where}: the pose lies {np.abs(translation).max():.0f} m from the origin")
    return SE3(rotation=rotation, translation=translation)


def numbers_of(pose: SE3) -> list[float]:
    """What `pose_of` reads."""
    return pose.as_matrix().reshape(-1).tolist()
