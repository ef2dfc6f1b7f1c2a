"""Obstacles that neither the scanner nor the body's voxel column shows: sills, feet, bars and tips.

The scanner's plane is at 0.15 m, and the voxel layer below it holds the floor. What stands between the height
that the wheels climb and that layer's top is known from the Gaussian map alone, whose centres lie within
millimetres of the surface. So is what reaches a centimetre or two out of an occupied voxel into one that most
rays cross freely: a leaf's tip, a pot's rim. And what was touched is known from the touch.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from jaxtyping import Bool, Float, Int32
from numpy import ndarray
from scipy.ndimage import binary_dilation, uniform_filter

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.native import kernels
from hgs_core.robot.ackermann import AckermannConfig
from hgs_core.robot.robot import RobotConfig, RobotState

_LOGIT_SOLID: Final = float(np.log(0.2 / 0.8))
"""Gaussians below an opacity of 0.2 are on their way out."""

_MIN_GAUSSIANS: Final = 3
"""So many solid Gaussians are a surface, fewer may be an error: in one cell, or, where cells are smaller than
this ..."""
_AROUND_M: Final = 0.1
"""... in a square at least so wide [m]."""

TOUCH_DEPTH_M: Final = 0.03
"""How far inside what was touched the mark is put."""

_TOUCH_HALF_ANGLE_RAD: Final = np.radians(30.0)


def low_surface_counts(
    gaussians: GaussianMap,
    robot: RobotConfig,
    *,
    below_m: float,
    lower_m: Float[ndarray, " 2"],
    size_m: float,
    shape: tuple[int, int],
) -> Int32[ndarray, "nx ny"]:
    """Solid Gaussians between the robot's step height and `below_m`, in each cell of a floor plan."""
    counts = np.zeros(shape, np.int32)
    layer = (robot.step_height_m, below_m, _LOGIT_SOLID, *lower_m, size_m)
    kernels.count_in_layer(gaussians.parameters[: gaussians.size], gaussians.block_bounds, layer, counts)
    return counts


def tips_in_the_way(
    gaussians: GaussianMap,
    robot: RobotConfig,
    *,
    above_m: float,
    lower_m: Float[ndarray, " 2"],
    size_m: float,
    occupied: Bool[ndarray, "nx ny"],
    places: Bool[ndarray, "nx ny"],
) -> Bool[ndarray, "nx ny"]:
    """Cells beside `occupied` ones, not occupied themselves, with solid Gaussians between `above_m` and the
    robot's height that it would touch when it stands in the middle of one of `places`.

    What barely shows beyond an occupied cell and touches nobody blocks nothing: doors stay as wide as they
    are. What hangs in free space, away from what the voxels know, is left to them, who forget what is gone.
    """
    beside = binary_dilation(occupied, np.ones((3, 3), bool)) & ~occupied
    counts = np.zeros(occupied.shape, np.int32)
    kernels.count_in_reach(
        gaussians.parameters[: gaussians.size],
        gaussians.block_bounds,
        (above_m, robot.height_m, _LOGIT_SOLID, *lower_m, size_m),
        beside.view(np.uint8),
        places.view(np.uint8),
        robot.radius_m / size_m,
        counts,
    )
    return are_surfaces(counts, size_m)


def are_surfaces(counts: Int32[ndarray, "nx ny"], size_m: float) -> Bool[ndarray, "nx ny"]:
    """Cells of `size_m` that hold solid Gaussians, enough of them with their surroundings to be a surface."""
    beside = max(0, math.ceil((_AROUND_M / size_m - 1.0) / 2.0 - 1e-6))
    width = 2 * beside + 1
    around = uniform_filter(counts.astype(np.float64), size=width, mode="constant") * width**2
    surfaces: Bool[ndarray, "nx ny"] = (counts > 0) & (np.round(around) >= _MIN_GAUSSIANS)
    return surfaces


class TouchMemory:
    """Where the robot has touched something: a contact proves what no sensor saw."""

    def __init__(self) -> None:
        self.points_m: Float[ndarray, "n 2"] = np.zeros((0, 2))
        self._contacts = 0

    def notice(self, robot: RobotState, config: RobotConfig) -> None:
        """For every new contact that its state counts, mark an arc ahead of the robot; of a car, the edge of
        its body that was ahead."""
        if robot.collisions > self._contacts:
            mark = _edge_ahead(robot, config) if isinstance(config, AckermannConfig) else _arc(robot, config)
            self.points_m = np.concatenate([self.points_m, mark])
        self._contacts = robot.collisions

    def state(self) -> dict[str, Any]:
        return {"points_m": self.points_m.copy(), "contacts": self._contacts}

    def restore(self, state: dict[str, Any]) -> None:
        self.points_m = np.array(state["points_m"]).reshape(-1, 2)
        self._contacts = int(state["contacts"])


def _arc(robot: RobotState, config: RobotConfig) -> Float[ndarray, "n 2"]:
    bearings = robot.yaw_rad + np.linspace(-_TOUCH_HALF_ANGLE_RAD, _TOUCH_HALF_ANGLE_RAD, 7)
    reach = config.radius_m + TOUCH_DEPTH_M
    return np.stack([robot.x_m + reach * np.cos(bearings), robot.y_m + reach * np.sin(bearings)], axis=1)


def _edge_ahead(robot: RobotState, car: AckermannConfig) -> Float[ndarray, "n 2"]:
    ahead = -car.rear_overhang_m - TOUCH_DEPTH_M if robot.reversing else car.front_m + TOUCH_DEPTH_M
    beside = np.linspace(-car.width_m / 2, car.width_m / 2, 7)
    cos, sin = np.cos(robot.yaw_rad), np.sin(robot.yaw_rad)
    return np.stack([robot.x_m + ahead * cos - beside * sin, robot.y_m + ahead * sin + beside * cos], axis=1)
