"""`GlassCamera`: an RGB-D camera in a world with glass in it, from which no depth comes back.

Active depth cameras get nothing back from panes, mirrors and black gloss: their depth has holes there, from
wherever they look. Patches of the scene's surface play that part here. Colours stay, and so do the scanner's
ranges.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Float32
from numpy import ndarray
from pydantic import Field

from hgs_core.geometry.se3 import SE3
from hgs_core.robot.robot import Robot
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.depth_camera import DepthCameraConfig
from hgs_core.simulation.camera import SimulatedCamera
from hgs_core.simulation.registry import SensorMethod

_PRIMES = np.array([0x8DA6B343, 0xD8163841, 0xCB1AB31F], dtype=np.uint64)
"""Large odd factors keep the cells of a lattice apart (Teschner et al., VMV 2003)."""
_MIX = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))
"""Multipliers of splitmix64 (Steele, Lea and Flood, OOPSLA 2014)."""


class GlassCameraConfig(DepthCameraConfig):
    """The holes are places of the scene: the same in every frame and every mission with one `glass_seed`."""

    method: Literal["glass"] = "glass"
    glass_share: float = Field(0.05, ge=0, le=1)
    """Share of the surface, above `glass_above_m`, that returns nothing."""
    glass_size_m: float = Field(0.5, gt=0)
    """Edge of the cubes of space whose surface is glass or is not [m]."""
    glass_above_m: float = 0.1
    """No surface below this height is glass [m]: the floor stays seen."""
    glass_seed: int = Field(0, ge=0)
    """Which places are glass."""


class GlassCamera(SimulatedCamera):
    """A `SimulatedCamera` whose depth is 0 (no return) on glass."""

    def __init__(
        self, caster: RayCaster, robot: Robot, config: GlassCameraConfig, rng: np.random.Generator
    ) -> None:
        super().__init__(caster, robot, config, rng)
        self._glass = config
        self._rays = config.intrinsics().rays()

    def returned(
        self, depth_m: Float32[ndarray, "height width"], T_world_camera: SE3
    ) -> Float32[ndarray, "height width"]:
        hit = np.isfinite(depth_m)
        points = T_world_camera.apply(self._rays[hit] * depth_m[hit][:, None].astype(float))
        depth = depth_m.copy()
        depth[hit] = np.where(is_glass(points, self._glass), np.float32(0.0), depth_m[hit])
        return depth


def is_glass(points_m: Float[ndarray, "n 3"], config: GlassCameraConfig) -> Bool[ndarray, " n"]:
    """Whether the surface at each point of the world returns nothing.

    Space is divided into cubes, and the hash of a cube's index decides. The lattice is moved by a part of its
    cell that depends on the seed, so that walls at round coordinates do not lie between two cells.
    """
    offset = np.random.default_rng(config.glass_seed).random(3)
    cells = np.floor(points_m / config.glass_size_m + offset).astype(np.int64).astype(np.uint64)
    mixed = np.bitwise_xor.reduce(cells * _PRIMES, axis=1) ^ np.uint64(config.glass_seed)
    for shift, factor in zip((30, 27), _MIX, strict=True):
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * factor
    mixed ^= mixed >> np.uint64(31)
    chance = (mixed >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return (chance < config.glass_share) & (points_m[:, 2] >= config.glass_above_m)


METHOD = SensorMethod(config=GlassCameraConfig, build=GlassCamera)
