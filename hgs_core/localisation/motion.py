"""How far a robot can have come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.se3 import SE3

_GRAM_ERROR = 1e-3


class MotionLimits(StrictConfig):
    """What is physically possible between two poses."""

    max_speed_mps: float = Field(2.0, gt=0)
    """Of the camera, in any direction [m/s]."""
    max_turn_rate_degps: float = Field(180.0, gt=0)
    """About any axis [degrees/s]."""
    slack_m: float = Field(0.05, ge=0)
    """Added to what the speed allows [m]: poses have errors."""
    slack_deg: float = Field(3.0, ge=0)
    """Added to what the turn rate allows [degrees]."""

    def violation(self, before: SE3, after: SE3, passed_s: float) -> str | None:
        """What of the motion from `before` to `after` within that time is impossible, in words; else None."""
        moved_m = float(np.linalg.norm(after.translation - before.translation))
        may_m = self.max_speed_mps * passed_s + self.slack_m
        if moved_m > may_m:
            return f"moved {moved_m:.2f} m in {passed_s:.2f} s, at most {may_m:.2f} m is possible"
        turned_deg = float(np.degrees(np.linalg.norm((before.inverse() @ after).log()[3:])))
        may_deg = self.max_turn_rate_degps * passed_s + self.slack_deg
        if turned_deg > may_deg:
            return f"turned {turned_deg:.1f} degrees in {passed_s:.2f} s, at most {may_deg:.1f} is possible"
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class StampedPose:
    """A pose and its time."""

    pose: SE3
    timestamp_s: float


def flaw(pose: SE3) -> str | None:
    """Why this is no pose, in words: not finite, or not rigid; None for a rotation and a translation."""
    numbers = np.concatenate([pose.rotation.ravel(), pose.translation.ravel()])
    if not np.isfinite(numbers).all():
        return "the pose is not finite"
    gram_error = float(np.abs(pose.rotation.T @ pose.rotation - np.eye(3)).max())
    if gram_error > _GRAM_ERROR:
        return f"the pose is not rigid: its axes are off orthonormal by {gram_error:.3g}"
    if np.linalg.det(pose.rotation) < 0:
        return "the pose is not rigid: it mirrors"
    return None
