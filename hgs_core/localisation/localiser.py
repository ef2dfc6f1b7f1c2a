"""What all methods of localisation are to whoever feeds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame


class LocalisationConfig(StrictConfig):
    """Settings of a method; each method has a subclass (`methods.py`)."""

    method: str
    """`given`, `rgbd-odometry` or `lidar-odometry`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Located:
    """Where a frame was taken."""

    T_world_camera: SE3


@dataclass(frozen=True, kw_only=True)
class Lost:
    """A frame whose pose is not known, or not believed: it must not reach the map."""

    reason: str
    """One sentence for the operator, with the value and its bound."""


@runtime_checkable
class Localiser(Protocol):
    """Takes frames and scans of one robot in the order of their times.

    Frames that are lost change nothing: the next one is judged by the last that was located. A method that
    does not use scans lets them pass.
    """

    def take_scan(self, scan: PointScan) -> None:
        """A turn of the lidar."""
        ...

    def locate(self, frame: AlignedFrame) -> Located | Lost:
        """Where the frame was taken, from it and from all frames and scans before it."""
        ...
