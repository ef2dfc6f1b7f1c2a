"""Settings of checkpoints."""

from __future__ import annotations

from pydantic import Field

from hgs_core.config.base import StrictConfig


class CheckpointConfig(StrictConfig):
    """How much of a mission a crash may cost, and what that may cost."""

    interval_s: float = Field(20.0, ge=0)
    """Mission time [s] between two checkpoints; 0 = none but those of a mission that is suspended."""
    most_share: float = Field(0.03, gt=0, le=1)
    """A checkpoint waits until those before have held up the mission for no more than this share of its wall
    time."""
    least_free_mib: int = Field(256, ge=0)
    """With less room than this on its disk [MiB] the mission waits before the next frame."""
