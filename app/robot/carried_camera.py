"""`CarriedCamera`: a recording on board, played by its own clock. Nobody can send it anywhere."""

from __future__ import annotations

import threading
from typing import Final

from app.robot.camera import TakenFrame
from app.robot.clock import RobotClock
from app.robot.onboard import Link
from app.robot.playback import Playback
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

_LOOK_S: Final = 0.02


class CarriedCamera:
    """Implements `Onboard`. It plays from the first welcome on; interruptions do not hold it up."""

    def __init__(
        self, playback: Playback, clock: RobotClock, *, name: str, speed: float = 1.0, waits: bool = False
    ) -> None:
        """`speed`: so many times as fast as it was recorded. `waits`: rather than skip a frame."""
        self.skipped = 0
        self.late = 0
        self.taken: dict[int, TakenFrame] = {}
        """By the frame's number."""
        self.error: StreamError | None = None
        """Why it broke off, if it did."""
        self._playback = playback
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
        began_s, times_s = self._clock.now_s(), self._playback.timestamps_s
        for index, at_s in enumerate((times_s - times_s[0]) / self._speed):
            due_s = began_s + float(at_s)
            if self._over.wait(max(due_s - self._clock.now_s(), 0.0)):
                return False
            while self._waits and not link.may_send_frame():
                if self._over.wait(_LOOK_S):
                    return False
            if not link.may_send_frame():
                self.skipped += 1
                continue
            taken_s = max(due_s, self._clock.now_s()) if self._waits else due_s
            frame = self._playback.frame(index, self._clock.told_s(taken_s))
            pose = self._playback.pose(index)
            if pose is not None:
                self.taken[index] = TakenFrame(timestamp_s=taken_s, T_world_camera=pose, estimate=pose)
            link.send_frame(frame, taken_s)
        return True
