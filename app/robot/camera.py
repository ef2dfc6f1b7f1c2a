"""`CameraLoop`: pictures at their rate, in a thread of its own; none is taken that could not be sent."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import numpy as np

from app.robot.clock import RobotClock
from app.robot.onboard import Link
from hgs_core.geometry.se3 import SE3
from hgs_core.live.images import encoded_colour, encoded_depth
from hgs_core.live.messages import Frame, ScanPart
from hgs_core.live.poses import numbers_of
from hgs_core.sensing.frame import Scan
from hgs_core.simulation.driven_robot import TICK_S
from hgs_core.simulation.driven_world import DrivenWorld, Sighting


@dataclass(frozen=True, kw_only=True, eq=False)
class TakenFrame:
    """Where a frame was taken."""

    timestamp_s: float
    T_world_camera: SE3
    """Truly."""
    estimate: SE3
    """As the robot believes, and as the frame says."""


class CameraLoop:
    """Takes a frame every `interval_s` by the robot's clock, if the link has a credit for it."""

    def __init__(
        self, world: DrivenWorld, clock: RobotClock, *, interval_s: float, depth_format: str
    ) -> None:
        self.skipped = 0
        self.late = 0
        self.taken: dict[int, TakenFrame] = {}
        """By the frame's number."""
        self.busy_s = 0.0
        """Seconds spent on rendering and encoding."""
        self._world = world
        self._clock = clock
        self._interval_s = interval_s
        self._depth_format = depth_format
        self._newest_s = -math.inf
        """Of the newest frame."""
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, link: Link) -> None:
        self._thread = threading.Thread(target=self._run, args=(link,), name="camera", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, link: Link) -> None:
        due_s = self._clock.now_s()
        while not self._over.wait(max(due_s - self._clock.now_s(), 0.0)):
            if not self._wait_for_another_moment():
                return
            if link.may_send_frame():
                began_s = self._clock.now_s()
                frame, taken_s = self._frame(self._world.sense())
                self.busy_s += self._clock.now_s() - began_s
                if not self._over.is_set():
                    link.send_frame(frame, taken_s)
            else:
                self.skipped += 1
            due_s += self._interval_s
            behind = int((self._clock.now_s() - due_s) / self._interval_s)
            if behind > 0:
                self.late += behind
                due_s += behind * self._interval_s

    def _wait_for_another_moment(self) -> bool:
        """No two frames are of one moment, however late the body is by the clock; False when it is over."""
        while self._world.robot.state.timestamp_s <= self._newest_s:
            if self._over.wait(TICK_S):
                return False
        return True

    def _frame(self, sighting: Sighting) -> tuple[Frame, float]:
        seen = sighting.frame
        self._newest_s = seen.timestamp_s
        self.taken[seen.sequence] = TakenFrame(
            timestamp_s=seen.timestamp_s,
            T_world_camera=sighting.T_world_camera,
            estimate=seen.T_world_camera,
        )
        message = Frame(
            sequence=seen.sequence,
            time_s=self._clock.told_s(seen.timestamp_s),
            pose=numbers_of(seen.T_world_camera),
            colour=encoded_colour(seen.rgb),
            depth=encoded_depth(seen.depth_m, depth_format=self._depth_format),
            depth_format="zstd" if self._depth_format == "zstd" else "png",
            scan=scan_part(sighting.scan),
        )
        return message, seen.timestamp_s


def scan_part(scan: Scan) -> ScanPart:
    """A scan of evenly spread rays, as it travels."""
    return ScanPart(
        origin_m=scan.origin_m.tolist(),
        first_bearing_rad=float(scan.bearings_rad[0]),
        step_rad=2.0 * np.pi / len(scan.bearings_rad),
        ranges_m=scan.ranges_m.astype("<f4").tobytes(),
    )
