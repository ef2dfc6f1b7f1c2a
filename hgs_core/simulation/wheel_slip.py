"""Wheels that slip: a robot moves less than its wheels turn."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from hgs_core.errors import ConfigError
from hgs_core.robot.motion import Twist

_CORRELATION_S: Final = 1.0
_WHEELS: Final = 3


class WheelSlip:
    """Each of two wheels, and sideways motion, loses a share of its own of what it is driven with.

    The shares wander between 0 and `greatest` (first-order Gauss-Markov about half of it, with a memory of
    1 s). Where the two wheels are driven independently, at a distance of `track_m`, unequal losses turn the
    robot; without a track the heading is held by steered or mecanum wheels, and turning loses a share alone.
    A slip of 0 changes nothing. Draws three numbers a tick, whatever is driven.
    """

    def __init__(self, greatest: float, track_m: float | None, rng: np.random.Generator) -> None:
        if not 0.0 <= greatest < 1.0:
            raise ConfigError(f"wheel slip {greatest}: expected a share of at least 0 and below 1")
        self._greatest = greatest
        self._track_m = track_m
        self._rng = rng
        self._lost = np.full(_WHEELS, greatest / 2)

    def applied(self, commanded: Twist, duration_s: float) -> Twist:
        """How the robot really moves for the next `duration_s` when its wheels do as commanded."""
        drawn = self._rng.standard_normal(_WHEELS)
        if self._greatest == 0.0:
            return commanded
        memory = math.exp(-duration_s / _CORRELATION_S)
        spread = self._greatest / 4 * math.sqrt(1.0 - memory * memory)
        mean = self._greatest / 2
        self._lost = np.clip(mean + memory * (self._lost - mean) + spread * drawn, 0.0, self._greatest)
        one, other, sideways = (1.0 - self._lost).tolist()
        left_mps = commanded.left_mps * sideways
        if self._track_m is None:
            return Twist(
                forward_mps=commanded.forward_mps * one,
                left_mps=left_mps,
                turn_radps=commanded.turn_radps * other,
            )
        half = 0.5 * self._track_m * commanded.turn_radps
        left_wheel, right_wheel = (commanded.forward_mps - half) * one, (commanded.forward_mps + half) * other
        return Twist(
            forward_mps=0.5 * (left_wheel + right_wheel),
            left_mps=left_mps,
            turn_radps=(right_wheel - left_wheel) / self._track_m,
        )
