"""`FrameLedger`: which frames may be sent, which were, and what became of them."""

from __future__ import annotations

from collections.abc import Callable

from app.robot.credits import Credits, OnItsWay
from app.robot.figures import LinkFigures
from app.robot.link_faults import FrameFaults, TakenAt
from hgs_core.live.messages import Answer, Frame


class FrameLedger:
    """Of the event loop's thread, but for `may_take` and `handed_over`, which are the camera's."""

    def __init__(self, figures: LinkFigures, faults: FrameFaults, now_s: Callable[[], float]) -> None:
        self._figures = figures
        self._faults = faults
        self._now_s = now_s
        self._credits: Credits | None = None
        """Those of a connection that was welcomed."""
        self._handed, self._had = 0, 0
        """Frames on their way between the two threads: each number is counted by one of them."""
        self._over = False

    @property
    def welcomed(self) -> bool:
        """Whether there is a connection that frames may be sent over."""
        return self._credits is not None

    def may_take(self) -> bool:
        """Whether there is a credit for a frame that is not taken yet."""
        credits = self._credits
        return credits is not None and not self._over and credits.left > self._handed - self._had

    def handed_over(self) -> None:
        """A frame is on its way to `sent`."""
        self._handed += 1

    def begin(self, credits: int) -> None:
        """A connection is welcomed."""
        self._credits = Credits(credits)

    def end(self) -> None:
        """It is lost, and what was on its way with it."""
        self._credits = None

    def close(self) -> None:
        """No more frames."""
        self._over = True

    def sent(self, frame: Frame, taken_s: float) -> list[Frame]:
        """What goes over the connection now that this frame has come: usually itself."""
        self._had += 1
        if self._credits is None:
            self._figures.lost += 1
            return []
        passed = self._faults.passed(TakenAt(frame, taken_s), credits_left=self._credits.left)
        for one in passed:
            self._credits.spend(one.frame.sequence, OnItsWay(taken_s=one.taken_s, sent_s=self._now_s()))
        self._figures.sent += len(passed)
        return [one.frame for one in passed]

    def answered(self, answer: Answer, received_s: float) -> None:
        """Counts what became of a frame, once."""
        frame = None if self._credits is None else self._credits.answered(answer)
        if frame is None:
            return
        figures = self._figures
        if answer.fate == "taken":
            figures.taken += 1
            figures.taken_sequences.append(answer.sequence)
            figures.sent_to_map_s.append(received_s - frame.sent_s)
            figures.captured_to_map_s.append(received_s - frame.taken_s)
        elif answer.fate == "dropped":
            figures.dropped += 1
        else:
            figures.refused += 1

    def starves_s(self) -> float:
        """How long no credit has been left because answers do not come [s]."""
        return 0.0 if self._credits is None else self._credits.waits_s(self._now_s())
