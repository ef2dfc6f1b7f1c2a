"""`CarriedCamera`: a recording on board, played by its own clock. Nobody can send it anywhere."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import takewhile
from typing import Final

from app.robot.camera import TakenFrame
from app.robot.clock import RobotClock
from app.robot.onboard import Link
from app.robot.playback import Playback
from app.robot.recorded_lidar import cloud_message
from hgs_core.errors import StreamError
from hgs_core.live.messages import (
    Ack,
    Bye,
    FollowPath,
    Hello,
    LimitSpeed,
    Report,
    Stop,
    Welcome,
)
from hgs_core.sensing.point_scan import PointScan

_LOOK_S: Final = 0.02


@dataclass(frozen=True, kw_only=True)
class _RecordedFrame:
    index: int
    timestamp_s: float


class CarriedCamera:
    """Implements `Onboard`. It plays from the first welcome on; interruptions do not hold it up.

    What it tells is taken so long after the first as it was when recorded, however fast it plays and however
    long it waits: motion between two frames and clouds is that of the recording.
    """

    def __init__(
        self,
        playback: Playback,
        clock: RobotClock,
        *,
        name: str,
        clouds: Iterable[PointScan] = (),
        speed: float = 1.0,
        waits: bool = False,
    ) -> None:
        """`clouds`: of a lidar beside the camera, their times rising, on the clock of the frames. `speed`: so
        many times as fast as it was recorded. `waits`: rather than skip a frame."""
        self.skipped = 0
        self.late = 0
        self.taken: dict[int, TakenFrame] = {}
        """By the frame's number."""
        self.error: StreamError | None = None
        """Why it broke off, if it did."""
        self._playback = playback
        self._clouds = clouds
        self._speed = speed
        self._waits = waits
        self._clock = clock
        self._name = name
        self._link: Link | None = None
        self._plays = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)

    def start(self, link: Link) -> None:
        self._link = link
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._plays.set()
        self._thread.join()

    def hello(self) -> Hello:
        return self._playback.hello(self._name)

    def report(self) -> Report | None:
        return None

    def welcomed(self, welcome: Welcome, received_s: float) -> None:
        self._plays.set()

    def heard(self, now_s: float, received_s: float) -> None:
        """Nothing depends on it."""

    def obey(self, command: FollowPath | Stop | LimitSpeed, received_s: float) -> None:
        assert self._link is not None
        reason = "this is a recording: it goes where it went"
        self._link.acknowledge(Ack(command=command.command, accepted=False, reason=reason))

    def halt(self) -> None:
        self._over.set()

    @property
    def standing(self) -> bool:
        return True

    def _run(self) -> None:
        assert self._link is not None
        self._plays.wait()
        try:
            is_whole = self._play(self._link)
        except Exception as error:  # whatever is wrong with a file, the mission is told that no more comes
            unread = StreamError(f"the recording cannot be read: {error!r}")
            self.error = error if isinstance(error, StreamError) else unread
            self._link.finish(Bye(reason="the recording is damaged"))
        else:
            if is_whole:
                self._link.finish(Bye(reason="the recording is over"))

    def _play(self, link: Link) -> bool:
        """Whether it came to its end."""
        began_s, first_s = self._clock.now_s(), None
        for item in self._recorded():
            first_s = item.timestamp_s if first_s is None else first_s
            since_s = item.timestamp_s - first_s
            due_s, told_s = began_s + since_s / self._speed, self._clock.told_s(began_s + since_s)
            if self._over.wait(max(due_s - self._clock.now_s(), 0.0)):
                return False
            # A cloud costs no credit, but does not run ahead of frames that are waited for.
            while self._waits and not link.may_send_frame():
                if self._over.wait(_LOOK_S):
                    return False
            if isinstance(item, PointScan):
                link.send_cloud(cloud_message(item, told_s))
            elif link.may_send_frame():
                taken_s = max(due_s, self._clock.now_s()) if self._waits else due_s
                self._send_frame(link, item.index, told_s, taken_s)
            else:
                self.skipped += 1
        return True

    def _recorded(self) -> Iterator[PointScan | _RecordedFrame]:
        """Frames and clouds in the order of their times, of one moment the cloud first; clouds after the last
        frame, which nothing is located by, are left out."""
        times_s = self._playback.timestamps_s
        frames = (_RecordedFrame(index=k, timestamp_s=float(t)) for k, t in enumerate(times_s))
        clouds = takewhile(lambda scan: scan.timestamp_s <= times_s[-1], self._clouds)
        both: tuple[Iterable[PointScan | _RecordedFrame], ...] = (clouds, frames)
        return heapq.merge(*both, key=lambda item: item.timestamp_s)

    def _send_frame(self, link: Link, index: int, told_s: float, taken_s: float) -> None:
        frame = self._playback.frame(index, told_s)
        pose = self._playback.pose(index)
        if pose is not None:
            self.taken[index] = TakenFrame(timestamp_s=taken_s, T_world_camera=pose, estimate=pose)
        link.send_frame(frame, taken_s)
