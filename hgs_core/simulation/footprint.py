"""How much room a body has among true obstacles: a disc, or a rectangle about its reference point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.robot import RobotConfig
from hgs_core.scene.obstacles import BodyObstacles

_FINEST_M = 0.002
"""What is nearer to the edge of a rectangle than this counts as touched."""


@runtime_checkable
class Footprint(Protocol):
    @property
    def reach_m(self) -> float:
        """How far the body reaches from its reference point."""
        ...

    def room_m(self, obstacles: BodyObstacles, x_m: float, y_m: float, yaw_rad: float) -> float:
        """Every point of the body may move so far without touching anything; 0 or less: it touches."""
        ...


@dataclass(frozen=True, kw_only=True)
class Disc:
    reach_m: float

    def room_m(self, obstacles: BodyObstacles, x_m: float, y_m: float, yaw_rad: float) -> float:
        return float(obstacles.clearance_m(np.array([x_m, y_m]))) - self.reach_m


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    rear_m: float
    front_m: float
    half_width_m: float

    @property
    def reach_m(self) -> float:
        return math.hypot(max(self.rear_m, self.front_m), self.half_width_m)

    def room_m(self, obstacles: BodyObstacles, x_m: float, y_m: float, yaw_rad: float) -> float:
        """Parts of the rectangle that the discs about them do not clear are quartered, down to 2 mm."""
        length = self.rear_m + self.front_m
        n = max(1, round(length / (2.0 * self.half_width_m)))
        half = np.array([length / (2 * n), self.half_width_m])
        ahead = -self.rear_m + half[0] * (2 * np.arange(n) + 1)
        parts = np.column_stack([ahead, np.zeros(n)])
        turn = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)], [-math.sin(yaw_rad), math.cos(yaw_rad)]])
        room = np.inf
        while len(parts):
            clearance = obstacles.clearance_m(parts @ turn + np.array([x_m, y_m]))
            around = float(np.hypot(*half))
            spare = clearance - around
            open_m = spare[spare > 0.0]
            room = min(room, float(open_m.min()) if len(open_m) else np.inf)
            parts = parts[spare <= 0.0]
            if len(parts) and (around <= _FINEST_M or bool(np.any(clearance <= 0.0))):
                return 0.0
            half = half / 2
            parts = np.concatenate([parts + half * signs for signs in _QUARTERS])
        return room


_QUARTERS: tuple[Float[ndarray, " 2"], ...] = tuple(
    np.array([float(i), float(j)]) for i in (-1, 1) for j in (-1, 1)
)


def footprint_of(config: RobotConfig) -> Footprint:
    if isinstance(config, AckermannConfig):
        return Rectangle(
            rear_m=config.rear_overhang_m, front_m=config.front_m, half_width_m=config.width_m / 2
        )
    return Disc(reach_m=config.radius_m)
