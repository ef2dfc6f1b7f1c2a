"""`Playback`: the seam between a camera that is carried and the recording that it plays."""

from __future__ import annotations

from typing import Protocol

from jaxtyping import Float
from numpy import ndarray

from hgs_core.geometry.se3 import SE3
from hgs_core.live.messages import Frame, Hello


class Playback(Protocol):
    """Frames in order; each is asked for once at most, in order."""

    @property
    def timestamps_s(self) -> Float[ndarray, " n_frames"]:
        """When each was taken, rising."""
        ...

    def hello(self, name: str) -> Hello:
        """Of the camera that took them."""
        ...

    def frame(self, index: int, time_s: float) -> Frame:
        """As it is sent, taken at `time_s` of the robot's clock. Raises `StreamError` for a damaged one."""
        ...

    def pose(self, index: int) -> SE3 | None:
        """Of a frame that has been given out; None where the recording does not tell."""
        ...
