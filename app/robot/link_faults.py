"""A bad link: frames that get lost or overtaken, messages that take their time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.live.messages import Frame


class LinkFaults(StrictConfig):
    """What is wrong with the link; by default nothing."""

    latency_s: float = Field(0.0, ge=0, le=60)
    """Every message takes so long, either way [s]."""
    drop_frames: float = Field(0.0, ge=0, le=1)
    """Share of the frames that get lost before they are sent."""
    reorder_frames: float = Field(0.0, ge=0, le=1)
    """Share of the frames that the next one overtakes."""


@dataclass(frozen=True)
class TakenAt:
    """A frame, and when the camera took it [s]."""

    frame: Frame
    taken_s: float


class FrameFaults:
    """Which frames get lost, and which are overtaken. Draws two numbers a frame, whatever becomes of it."""

    def __init__(self, faults: LinkFaults, rng: np.random.Generator) -> None:
        self._faults = faults
        self._rng = rng
        self._held: TakenAt | None = None
        self.lost = 0
        self.overtaken = 0

    def passed(self, frame: TakenAt, *, credits_left: int) -> list[TakenAt]:
        """The frames to send now, at most `credits_left` of them, in this order."""
        lost, held = self._rng.random(2) < (self._faults.drop_frames, self._faults.reorder_frames)
        before, self._held = self._held, None
        if lost:
            self.lost += 1
            frames = [] if before is None else [before]
        elif before is not None:
            frames = [frame, before]
            self.overtaken += 1
        elif held:
            self._held, frames = frame, []
        else:
            frames = [frame]
        self.lost += len(frames[credits_left:])
        return frames[:credits_left]
