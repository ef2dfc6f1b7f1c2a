"""`LiveClock`: mission time as a live robot lives it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Final

from hgs_core.live.correspondence import Correspondence
from hgs_core.mission.clock import IDLE_SHARE, ClockKind, NextFrame

_LOOK_S: Final = 0.05


class LiveClock:
    """Implements `Clock`: nothing that the loop does costs the robot time, which passes by itself.

    A frame is due when one has come. Optimisation may go on until `IDLE_SHARE` of the camera's interval is
    left before the next is expected.
    """

    kind = ClockKind.REAL
    world_goes_on = True

    def __init__(self, correspondence: Correspondence, frame_interval_s: float) -> None:
        self._correspondence = correspondence
        self._learning_s = (1.0 - IDLE_SHARE) * frame_interval_s

    def elapsed_s(self, *, nominal_s: float) -> float:
        return 0.0

    def stopped(self) -> AbstractContextManager[None]:
        return nullcontext()

    def paused(self) -> AbstractContextManager[None]:
        return self._correspondence.time.paused()

    @property
    def time_left(self) -> Callable[[], bool] | None:
        correspondence = self._correspondence
        return lambda: not correspondence.has_frame and correspondence.frame_age_s < self._learning_s

    def next_frame(self, *, interrupted: Callable[[], bool]) -> NextFrame:
        """Also comes back, without a frame, when there is a reason to wait for one (`why_wait`)."""
        correspondence = self._correspondence

        def is_time() -> bool:
            return (
                correspondence.has_frame
                or correspondence.over is not None
                or correspondence.why_wait() is not None
            )

        while not correspondence.wait_for_news(_LOOK_S, is_time) and not interrupted():
            pass
        return NextFrame(after_s=0.0, dropped=correspondence.take_dropped())

    def state(self) -> dict[str, Any]:
        """The world keeps mission time."""
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""
