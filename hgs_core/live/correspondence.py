"""`Correspondence`: everything that is heard from a robot, as soon as it comes, and a heartbeat in return."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Literal

import numpy as np

from hgs_core.errors import HgsError, StreamError
from hgs_core.geometry.se3 import SE3
from hgs_core.live.checks import MessageChecks, refusal_of
from hgs_core.live.config import LiveConfig
from hgs_core.live.frame_reader import FrameReader, LiveFrame
from hgs_core.live.link import Link
from hgs_core.live.messages import (
    PROTOCOL,
    Ack,
    Answer,
    Bye,
    Cloud,
    Frame,
    FromRobot,
    Heartbeat,
    Hello,
    Report,
    ToRobot,
    Welcome,
    encoded,
    from_robot,
)
from hgs_core.live.mission_time import MissionTime
from hgs_core.localisation.localiser import Localiser

log = logging.getLogger(__name__)

CREDITS: Final = 2
"""One frame that is taken in, and one that waits."""
_BEAT_S: Final = 0.5
_LISTEN_S: Final = 0.1
_REPORTS_KEPT: Final = 200
_REASON_LENGTH: Final = 300


class Correspondence:
    """Safe to use from any thread. Two of its own listen and beat from `begin` to `close`.

    Mission time is the service's, counted from the first hello and standing still while `paused`; the robot's
    clock only orders its own messages.
    """

    def __init__(
        self,
        link: Link,
        config: LiveConfig,
        *,
        localiser_from: Callable[[SE3], Localiser],
        earlier: dict[str, Any] | None = None,
        notice: Callable[[float, str], None] = lambda _t, _m: None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """`localiser_from` makes a localiser that begins at a camera's pose. `notice` is told, with mission
        time, what an operator should know; from any thread. `earlier`: the `state` of a process before, which
        this one goes on from."""
        self._link = link
        self._config = config
        self._notice = notice
        self._now = now
        self.time = MissionTime(now, earlier_s=0.0 if earlier is None else float(earlier["time_s"]))
        """Counted from the first hello."""
        self._changed = threading.Condition()
        self._checks = MessageChecks()
        self._hello: Hello | None = None
        self._reader = FrameReader(localiser_from, located=None if earlier is None else earlier["located"])
        self._reports: deque[Report] = deque(maxlen=_REPORTS_KEPT)
        self._frame: LiveFrame | None = None
        self._n_dropped = 0
        self._heard_at: float | None = None
        self._frame_at: float | None = None
        self._over: str | None = None
        self._was_waited_for = False
        self._taken_at: float | None = None
        self._refused: str | None = None
        """Why the newest frame was not accepted, if it was not."""
        self._on_report: Callable[[Report], None] = lambda _: None
        self._on_ack: Callable[[Ack], None] = lambda _: None
        self._on_hello: Callable[[Hello], None] = lambda _: None
        self._on_beat: Callable[[], None] = lambda: None
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=self._listen, name="robot-listener", daemon=True),
            threading.Thread(target=self._beat, name="robot-heartbeat", daemon=True),
        ]

    def begin(self) -> None:
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Say nothing more, and hear nothing more."""
        self._closing.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def listen_with(
        self,
        *,
        on_hello: Callable[[Hello], None],
        on_report: Callable[[Report], None],
        on_ack: Callable[[Ack], None],
        on_beat: Callable[[], None],
    ) -> None:
        """Call these from now on, from the listening and the beating thread: a hello after the first, every
        report and ack, and twice a second."""
        self._on_hello, self._on_report = on_hello, on_report
        self._on_ack, self._on_beat = on_ack, on_beat

    @property
    def hello(self) -> Hello | None:
        return self._hello

    @property
    def now_s(self) -> float:
        """The clock that messages to the robot bear [s]."""
        return self._now()

    @property
    def time_s(self) -> float:
        """Mission time [s]."""
        return self.time.now_s

    @property
    def report(self) -> Report | None:
        """The newest."""
        with self._changed:
            return self._reports[-1] if self._reports else None

    @property
    def has_frame(self) -> bool:
        return self._frame is not None

    def take_frame(self) -> LiveFrame | None:
        """The newest frame that has not been taken yet."""
        with self._changed:
            taken, self._frame = self._frame, None
            if taken is not None:
                self._taken_at = self._now()
            return taken

    def take_dropped(self) -> int:
        """Frames that newer ones overtook since the last call."""
        with self._changed:
            dropped, self._n_dropped = self._n_dropped, 0
            return dropped

    def why_wait(self) -> str | None:
        """Why the robot must not drive now: it has not been heard, or has not seen, for too long. A reason
        lasts until the next frame."""
        with self._changed:
            reason = self._why_silent() or ("waits for a frame" if self._was_waited_for else None)
            if self._frame is not None or self._over is not None:
                reason = None
            self._was_waited_for = reason is not None
            return reason

    def _why_silent(self) -> str | None:
        now = self._now()
        if self._heard_at is not None and now - self._heard_at > self._config.dead_man_s:
            return f"no word from the robot for {self._config.dead_man_s:g} s: it has stopped by itself"
        if self._frame_at is not None and now - self._frame_at > self._config.frame_s:
            refused = "" if self._refused is None else f"; the last one was refused: {self._refused}"
            return f"no frame from the robot for {self._config.frame_s:g} s: it is stopped{refused}"
        return None

    @property
    def frame_age_s(self) -> float:
        """Seconds since the newest frame came; +inf without one."""
        frame_at = self._frame_at
        return np.inf if frame_at is None else self._now() - frame_at

    @property
    def blind_s(self) -> float:
        """Seconds since the loop took a frame; 0 before the first."""
        taken_at = self._taken_at
        return 0.0 if taken_at is None else self._now() - taken_at

    @property
    def over(self) -> str | None:
        """Why nothing more will come, in the robot's words; None as long as something may."""
        return self._over

    def wait_for_news(self, timeout_s: float, until: Callable[[], bool]) -> bool:
        """Wait until `until`, which is asked whenever something has come; whether it is so."""
        with self._changed:
            return self._changed.wait_for(until, timeout_s)

    def notice(self, message: str) -> None:
        """Let the operator know."""
        self._notice(self.time_s, message)

    def send(self, message: ToRobot) -> None:
        """A link that is gone is no error here: the silence that follows is what counts."""
        try:
            self._link.send(encoded(message))
        except StreamError as error:
            log.debug("not sent: %s", error)

    def answer(self, sequence: int, fate: Literal["taken", "dropped", "refused"], reason: str = "") -> None:
        """Say what became of a frame."""
        self.send(Answer(now_s=self.now_s, sequence=sequence, fate=fate, reason=reason))

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                content = self._link.receive(_LISTEN_S)
            except StreamError as error:
                log.warning("%s", error)
                return
            if content is not None:
                self.hear(content)

    def hear(self, content: bytes) -> None:
        """Take in one message, or refuse it."""
        message: FromRobot | None = None
        try:
            message = from_robot(content)
            self._checks.admit(message)
            self._take(message)
        except HgsError as error:
            self._refuse(message, str(error))
        except Exception as error:
            # What a robot sends must not end the thread that hears it.
            log.exception("a robot's message could not be taken in")
            self._refuse(message, f"it could not be taken in: {error!r}"[:_REASON_LENGTH])

    def _refuse(self, message: FromRobot | None, reason: str) -> None:
        if isinstance(message, Hello):
            self._checks = MessageChecks()  # whoever it is, nothing more is heard before another hello
        self.send(refusal_of(message, reason, now_s=self.now_s))

    def _take(self, message: FromRobot) -> None:
        with self._changed:
            self._heard_at = self._now()
        if isinstance(message, Hello):
            self._take_hello(message)
        elif isinstance(message, Frame):
            self._take_in(message)
        elif isinstance(message, Cloud):
            self._reader.take_cloud(message)
        elif isinstance(message, Report):
            with self._changed:
                self._reports.append(message)
                self._changed.notify_all()
            self._on_report(message)
        elif isinstance(message, Ack):
            self._on_ack(message)
        elif isinstance(message, Bye):
            with self._changed:
                self._over = message.reason
                self._changed.notify_all()

    def _take_hello(self, hello: Hello) -> None:
        known = self._hello
        if known is not None and _carries(known) != _carries(hello):
            raise StreamError(
                "this is another robot than the mission began with: its camera or its drive differs. "
                "Start a mission of its own for it"
            )
        self._reader.begin(hello)
        self.time.begin()
        with self._changed:
            self._hello, self._frame = hello, None
            self._reports.clear()
            if hello.report is not None:
                self._reports.append(hello.report)
            self._changed.notify_all()
        self.send(
            Welcome(
                protocol=PROTOCOL,
                mission=self._link.name,
                now_s=self.now_s,
                dead_man_s=self._config.dead_man_s,
                credits=CREDITS,
            )
        )
        if known is not None:
            self.notice(f"{hello.name} is back: what it was on its way to is planned anew")
            self._on_hello(hello)

    def _take_in(self, frame: Frame) -> None:
        with self._changed:
            report = next((r for r in reversed(self._reports) if r.time_s <= frame.time_s), None)
        try:
            live = self._reader.read(frame, report, time_s=self.time_s)
        except HgsError as error:
            self._refused = str(error)
            self.answer(frame.sequence, "refused", self._refused)
            return
        with self._changed:
            self._refused = None
            overtaken, self._frame = self._frame, live
            self._frame_at = self._now()
            if overtaken is not None:
                self._n_dropped += 1
            self._changed.notify_all()
        if overtaken is not None:
            self.answer(overtaken.frame.sequence, "dropped")

    def _beat(self) -> None:
        while not self._closing.wait(_BEAT_S):
            self.send(Heartbeat(now_s=self.now_s))
            self._on_beat()

    def state(self) -> dict[str, Any]:
        located = self._reader.located
        return {"time_s": self.time_s, "located": None if located is None else located.as_matrix()}


def _carries(hello: Hello) -> tuple[object, ...]:
    """What must not change within a mission."""
    return hello.camera, hello.depth_camera, hello.robot
