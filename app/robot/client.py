"""`RobotClient`: the robot's side of the connection, over interruptions."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any, Final

from websockets.asyncio.client import ClientConnection
from websockets.exceptions import InvalidHandshake, InvalidStatus, InvalidURI

from app.robot.clock import RobotClock
from app.robot.connection import Connection
from app.robot.figures import LinkFigures
from app.robot.frame_ledger import FrameLedger
from app.robot.link_faults import FrameFaults, LinkFaults
from app.robot.onboard import Onboard
from app.robot.outcome import MissionWord, Outcome
from hgs_core.errors import RobotError
from hgs_core.live.messages import (
    Ack,
    Answer,
    Bye,
    Cloud,
    End,
    FollowPath,
    Frame,
    FromRobot,
    LimitSpeed,
    Refusal,
    Stop,
    ToRobot,
    Welcome,
)

_BACKOFF_S: Final = (0.2, 5.0)
_WELCOME_S: Final = 30.0
"""A mission's process may still be starting; or the hello was spoilt on its way, and is to be said again."""
_LEAST_SILENCE_S: Final = 3.0
"""A connection on which nothing is heard for so long, or for twice the dead-man's time, is given up."""
_STAND_S: Final = 5.0
_LAST_WORDS_S: Final = 30.0
"""After `Bye` the service may take so long to say `End`."""
_ANSWER_S: Final = 10.0
_HOPELESS: Final = frozenset({400, 401, 403, 404, 405, 422, 4401, 4404})
"""HTTP statuses and close codes that trying again does not change."""
_TOO_LARGE: Final = 1009
"""A message is larger than the service takes. It may be a broken line's, and not this robot's ..."""
_MOST_TOO_LARGE: Final = 5
"""... but not so often in a row, with no frame between that the service has taken."""
_REPLACED: Final = 4409
_NOT_NOW: Final = 4410
_NO_MORE: Final = 4411


class RobotClient:
    """Connects, says hello, sends and obeys; connects again when the connection is lost. Implements `Link`.

    `mission_word` is asked when the service cannot be reached or does not let the robot in; it raises
    `OSError` or `RobotError` where nobody can tell.
    """

    def __init__(
        self,
        url: str,
        onboard: Onboard,
        *,
        token: str | None,
        clock: RobotClock,
        faults: LinkFaults,
        frame_faults: FrameFaults,
        give_up_after_s: float,
        mission_word: Callable[[], MissionWord],
        say: Callable[[str], None],
    ) -> None:
        self.figures = LinkFigures()
        self.ending = ""
        """Why it is over, in words."""
        self._url = url
        self._onboard = onboard
        self._headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        self._clock = clock
        self._faults = faults
        self._frames = FrameLedger(self.figures, frame_faults, clock.now_s)
        self._give_up_after_s = give_up_after_s
        self._mission_word = mission_word
        self._mission_waits = False
        self._too_large = 0
        """Connections that ended with `_TOO_LARGE` since a frame was taken."""
        self._say = say
        self._loop: asyncio.AbstractEventLoop | None = None
        self._connection: Connection | None = None
        self._hello_at = 0.0
        """When the newest was said, by `time.monotonic`."""
        self._outcome: Outcome | None = None
        self._bye: Bye | None = None
        """What it has said, and says again on a new connection, until it is over."""
        self._over = asyncio.Event()

    async def run(self) -> Outcome:
        """Until the mission is over, the service is out of reach, or `interrupt`. The robot then stands."""
        self._loop = asyncio.get_running_loop()
        self._onboard.start(self)
        try:
            await self._stay_connected()
        finally:
            self._onboard.halt()
            deadline_s = time.monotonic() + _STAND_S
            while not self._onboard.standing and time.monotonic() < deadline_s:
                await asyncio.sleep(0.02)
            await asyncio.to_thread(self._onboard.close)
        assert self._outcome is not None
        return self._outcome

    def interrupt(self) -> None:
        """Stand and leave; the mission is left to its operator. From the event loop's thread."""
        self._onboard.halt()
        self._end(Outcome.INTERRUPTED, "interrupted by the robot's operator")

    # `Link`, from any thread.

    def may_send_frame(self) -> bool:
        return self._frames.may_take()

    def send_frame(self, frame: Frame, taken_s: float) -> None:
        self._frames.handed_over()
        self._from_any_thread(self._send_frame, frame, taken_s)

    def send_cloud(self, cloud: Cloud) -> None:
        self._from_any_thread(self._send_cloud, cloud)

    def acknowledge(self, ack: Ack) -> None:
        self._from_any_thread(self._send, ack)

    def finish(self, bye: Bye) -> None:
        self._from_any_thread(self._finish, bye)

    def _from_any_thread(self, call: Callable[..., Any], *arguments: object) -> None:
        assert self._loop is not None
        try:
            self._loop.call_soon_threadsafe(call, *arguments)
        except RuntimeError:
            # The loop is closed: the connection, and whatever could be said over it, has come to its end.
            self.figures.lost += isinstance(arguments[0], Frame)

    # From here on, all is of the event loop's thread.

    async def _stay_connected(self) -> None:
        backoff_s, reached_s = _BACKOFF_S[0], time.monotonic()
        while not self._over.is_set():
            welcomed_before = self.figures.connections
            problem = await self._connected()
            if self._over.is_set():
                return
            if self.figures.connections > welcomed_before:
                backoff_s, reached_s = _BACKOFF_S[0], time.monotonic()
            if await self._is_over():
                return
            if self._mission_waits:
                reached_s = time.monotonic()
            if time.monotonic() - reached_s >= self._give_up_after_s:
                self._end(Outcome.GIVEN_UP, f"no connection for {self._give_up_after_s:g} s: {problem}")
                return
            self._say(f"no connection: {problem}; trying again in {backoff_s:.1f} s")
            await self._unless_over(asyncio.sleep(backoff_s))
            backoff_s = min(2.0 * backoff_s, _BACKOFF_S[1])

    async def _is_over(self) -> bool:
        self._mission_waits = False
        try:
            word: MissionWord | None = await self._unless_over(asyncio.to_thread(self._mission_word))
        except (OSError, RobotError) as error:
            self._say(f"the service does not say how the mission is: {error}")
            return False
        if word is not None:
            self._mission_waits = word.waits
            if word.over is not None:
                self._end(Outcome.ENDED, word.over)
        return self._over.is_set()

    async def _connected(self) -> str:
        """One connection; why it ended."""
        try:
            socket: ClientConnection | None = await self._unless_over(
                Connection.open(self._url, self._headers)
            )
        except InvalidStatus as error:
            status = error.response.status_code
            problem = f"the service refuses the robot: HTTP {status} {_text(error.response.body)}"
            if status in _HOPELESS and not await self._is_over():
                raise RobotError(problem) from error
            return problem
        except InvalidURI as error:
            raise RobotError(f"{self._url} is no address of a service: {error}") from error
        except (OSError, TimeoutError, InvalidHandshake) as error:
            return f"{self._url} cannot be reached: {error or 'it does not answer'}"
        if socket is None:
            return self.ending
        self._connection = Connection(
            socket,
            latency_s=self._faults.latency_s,
            silence_s=_WELCOME_S,
            hear=self._hear,
            misheard=self._misheard,
            report=lambda: self._onboard.report() if self._frames.welcomed else None,
            complaint=self._complaint,
        )
        self._send(self._onboard.hello())
        self._hello_at = time.monotonic()
        connection = self._connection
        try:
            problem = await connection.talk(self._over)
        finally:
            self._connection = None
            self._frames.end()
        self._too_large += connection.close_code == _TOO_LARGE
        if connection.close_code == _NO_MORE and not self._over.is_set():
            self._end(Outcome.ENDED, problem)
        elif connection.close_code == _NOT_NOW:
            self._mission_waits = True
        elif connection.close_code == _REPLACED and not self._over.is_set():
            self._end(Outcome.GIVEN_UP, "another robot has taken this one's place in the mission")
        elif self._is_hopeless(connection.close_code) and not self._over.is_set():
            raise RobotError(f"the service refuses the robot: {problem}")
        return problem

    def _is_hopeless(self, close_code: int | None) -> bool:
        return close_code in _HOPELESS or self._too_large >= _MOST_TOO_LARGE

    def _complaint(self) -> str | None:
        """A welcome or answers that never come would leave a robot without credits, and the mission without
        frames, however much else is said."""
        waits_s = time.monotonic() - self._hello_at
        if not self._frames.welcomed and waits_s > _WELCOME_S:
            return f"no welcome for {waits_s:.0f} s"
        starves_s = self._frames.starves_s()
        return f"no frame was answered for {starves_s:.0f} s" if starves_s > _ANSWER_S else None

    def _hear(self, message: ToRobot) -> None:
        received_s = self._clock.now_s()
        if isinstance(message, Welcome):
            self._welcomed(message, received_s)
        if _is_of_mission(message):
            self._onboard.heard(message.now_s, received_s)
        match message:
            case Answer():
                self._frames.answered(message, received_s)
                if message.fate == "taken":
                    self._too_large = 0
                if message.fate == "refused":
                    self._say(f"frame {message.sequence} is refused: {message.reason}")
            case FollowPath() | Stop() | LimitSpeed():
                self._onboard.obey(message, received_s)
            case Refusal():
                self.figures.refusals += 1
                self._say(f"the service refuses a message: {message.reason}")
            case End():
                self._onboard.halt()
                self._end(Outcome.ENDED, message.reason)
            case _:
                pass

    def _misheard(self, problem: str) -> None:
        self.figures.not_understood += 1
        self._say(f"a message of the service is not understood: {problem}")

    async def _unless_over(self, wait: Coroutine[Any, Any, Any]) -> Any:
        """The result of `wait`, or None as soon as it is over."""
        tasks = [asyncio.create_task(wait), asyncio.create_task(self._over.wait())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            return tasks[0].result() if tasks[0].done() else None
        finally:
            for task in tasks:
                task.cancel()

    def _welcomed(self, welcome: Welcome, received_s: float) -> None:
        if not self._frames.welcomed:
            self.figures.connections += 1
            self._say(f"connected: mission {welcome.mission}")
        self._frames.begin(welcome.credits)
        if self._connection is not None:
            self._connection.silence_s = max(2.0 * welcome.dead_man_s, _LEAST_SILENCE_S)
        self._onboard.welcomed(welcome, received_s)
        if self._bye is not None:
            self._send(self._bye)

    def _send(self, message: FromRobot) -> bool:
        """Lost, and False, where there is no connection or too much waits for it."""
        return self._connection is not None and self._connection.send(message)

    def _send_frame(self, frame: Frame, taken_s: float) -> None:
        for one in self._frames.sent(frame, taken_s):
            self._send(one)

    def _send_cloud(self, cloud: Cloud) -> None:
        is_sent = self._frames.welcomed and self._send(cloud)
        self.figures.clouds_sent += is_sent
        self.figures.clouds_lost += not is_sent

    def _finish(self, bye: Bye) -> None:
        self._bye = bye
        self._frames.close()
        self._send(bye)
        if self._connection is not None:
            self._connection.silence_s = max(self._connection.silence_s, _LAST_WORDS_S)

    def _end(self, outcome: Outcome, why: str) -> None:
        if self._outcome is None:
            self._outcome, self.ending = outcome, why
            self._over.set()


def _is_of_mission(message: ToRobot) -> bool:
    """Whether the mission's process says it: what the service answers by itself shows no mission alive."""
    return not isinstance(message, Refusal) and not (isinstance(message, Answer) and message.fate != "taken")


def _text(body: bytes | bytearray | None) -> str:
    """The beginning of an HTTP answer, on one line."""
    return " ".join((body or b"").decode("utf-8", errors="replace").split())[:300]
