"""Trajectory files in the TUM RGB-D layout: `timestamp tx ty tz qx qy qz qw`, one pose a line.

Poses are `T_world_camera` of the frames that were integrated, in order; `#` starts a comment.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.errors import StreamError
from hgs_core.geometry.se3 import SE3


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """`n` stamped poses; `poses` is batched over one axis."""

    timestamps_s: Float[ndarray, " n"]
    poses: SE3

    def __post_init__(self) -> None:
        n = len(self.timestamps_s)
        if self.poses.rotation.shape != (n, 3, 3) or self.poses.translation.shape != (n, 3):
            raise StreamError(
                f"trajectory has {n} timestamps but poses of shape {self.poses.translation.shape}; "
                f"expected ({n}, 3)"
            )

    def __len__(self) -> int:
        return len(self.timestamps_s)


def write_trajectory(trajectory: Trajectory, path: Path) -> None:
    """Write `path` whole or not at all; six decimals of seconds, nine of metres and quaternions."""
    quaternions_wxyz = trajectory.poses.as_quaternion_wxyz() if len(trajectory) else np.zeros((0, 4))
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for stamp, translation, (w, x, y, z) in zip(
        trajectory.timestamps_s, trajectory.poses.translation, quaternions_wxyz, strict=True
    ):
        numbers = " ".join(f"{value:.9f}" for value in (*translation, x, y, z, w))
        lines.append(f"{stamp:.6f} {numbers}")
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    partial.write_text("\n".join(lines) + "\n", encoding="ascii")
    partial.replace(path)


def read_trajectory(path: Path) -> Trajectory:
    """Raises `StreamError` naming the line that has not eight finite numbers or no unit quaternion."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise StreamError(f"cannot read {path}: {error.strerror}") from error
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.split("#", 1)[0].strip()
        if not line:
            continue
        try:
            row = [float(word) for word in line.split()]
        except ValueError as error:
            raise StreamError(f"{path}:{number}: {line!r} is not a row of numbers") from error
        if len(row) != 8 or not np.isfinite(row).all():
            raise StreamError(f"{path}:{number}: expected 8 finite numbers (TUM), got {line!r}")
        norm = float(np.linalg.norm(row[4:]))
        if abs(norm - 1.0) > 1e-3:
            raise StreamError(f"{path}:{number}: quaternion has norm {norm:.4f}, expected 1")
        rows.append(row)
    table = np.array(rows, dtype=float).reshape(-1, 8)
    if len(table) == 0:
        poses = SE3(rotation=np.zeros((0, 3, 3)), translation=np.zeros((0, 3)))
    else:
        poses = SE3.from_quaternion_wxyz(table[:, [7, 4, 5, 6]], table[:, 1:4])
    return Trajectory(timestamps_s=table[:, 0], poses=poses)
