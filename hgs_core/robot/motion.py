"""Motion on the floor plane: poses, velocities, and where a constant velocity leads."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hgs_core.robot.kinematics import wrapped

_STRAIGHT_RADPS = 1e-9


@dataclass(frozen=True, kw_only=True)
class GroundPose:
    """Where a robot's reference point is, and which way it heads (counter-clockwise from world +x)."""

    x_m: float
    y_m: float
    yaw_rad: float

    def seen_from(self, other: GroundPose) -> GroundPose:
        """This pose in the frame of `other`: x ahead of it, y to its left."""
        dx, dy = self.x_m - other.x_m, self.y_m - other.y_m
        cos, sin = math.cos(other.yaw_rad), math.sin(other.yaw_rad)
        return GroundPose(
            x_m=cos * dx + sin * dy, y_m=cos * dy - sin * dx, yaw_rad=wrapped(self.yaw_rad - other.yaw_rad)
        )

    def then(self, step: GroundPose) -> GroundPose:
        """The pose that `step` is in this pose's frame: the inverse of `seen_from`."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return GroundPose(
            x_m=self.x_m + cos * step.x_m - sin * step.y_m,
            y_m=self.y_m + sin * step.x_m + cos * step.y_m,
            yaw_rad=wrapped(self.yaw_rad + step.yaw_rad),
        )


@dataclass(frozen=True, kw_only=True)
class Twist:
    """A velocity in the robot's own frame."""

    forward_mps: float = 0.0
    left_mps: float = 0.0
    turn_radps: float = 0.0

    @property
    def is_still(self) -> bool:
        return self.forward_mps == 0.0 and self.left_mps == 0.0 and self.turn_radps == 0.0


STILL = Twist()


def moved(pose: GroundPose, twist: Twist, duration_s: float) -> GroundPose:
    """Where a constant twist leads from `pose`: the exact arc."""
    angle = twist.turn_radps * duration_s
    ahead, left = twist.forward_mps * duration_s, twist.left_mps * duration_s
    if abs(twist.turn_radps) < _STRAIGHT_RADPS:
        return pose.then(GroundPose(x_m=ahead, y_m=left, yaw_rad=angle))
    sin, versine = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle
    return pose.then(
        GroundPose(x_m=sin * ahead - versine * left, y_m=versine * ahead + sin * left, yaw_rad=angle)
    )
