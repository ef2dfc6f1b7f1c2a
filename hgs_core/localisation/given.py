"""Poses that the stream brings along."""

from __future__ import annotations

from typing import Literal

from hgs_core.localisation.localiser import LocalisationConfig, Located, Lost
from hgs_core.localisation.motion import MotionLimits, StampedPose, flaw
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame


class GivenConfig(LocalisationConfig):
    """Believes the frames' poses, unless they are impossible."""

    method: Literal["given"] = "given"
    limits: MotionLimits = MotionLimits()
    """A pose that is farther from the last believed one than this allows is refused. The longer the wait, the
    more is possible, so a robot that was carried is believed again after a while."""


class GivenPoses:
    """Implements `Localiser`: refuses poses that are missing, not finite, not rigid, or a jump."""

    def __init__(self, config: GivenConfig) -> None:
        self._config = config
        self._last: StampedPose | None = None

    def take_scan(self, scan: PointScan) -> None:
        """Scans pass."""

    def locate(self, frame: AlignedFrame) -> Located | Lost:
        pose = frame.T_world_camera
        if pose is None:
            return Lost(reason="the frame has no pose; send poses, or set localisation.method to an odometry")
        wrong = flaw(pose)
        if wrong is None and self._last is not None:
            passed_s = frame.timestamp_s - self._last.timestamp_s
            if passed_s <= 0:
                wrong = f"its time {frame.timestamp_s:.3f} s is not after {self._last.timestamp_s:.3f} s"
            else:
                wrong = self._config.limits.violation(self._last.pose, pose, passed_s)
        if wrong is not None:
            return Lost(reason=f"frame {frame.sequence} refused: {wrong}")
        self._last = StampedPose(pose=pose, timestamp_s=frame.timestamp_s)
        return Located(T_world_camera=pose)
