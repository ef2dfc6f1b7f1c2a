"""What a mission shows: its newest view, the images and the map from above made of it, its moments."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.missions.display import DisplayView
from app.missions.moment_recorder import MomentRecorder
from app.missions.moments import MomentArchive
from app.missions.pictures import Picture, load_view, picture_of, save_view
from app.missions.top_view import top_view, top_view_facts

log = logging.getLogger(__name__)


class MissionViews:
    """Of a mission that runs, in memory; of one that does not, from its file. Views are numbered from 1."""

    def __init__(
        self,
        file: Path,
        moments: MomentArchive,
        *,
        saved: Callable[[], int],
        failed: Callable[[str, float], None],
    ) -> None:
        """`saved()` is the number of the view in `file`, 0 = none; `failed` is `MomentRecorder`'s."""
        self.moments = moments
        self._file = file
        self._saved = saved
        self._recorder = MomentRecorder(moments, failed=failed)
        self._before = saved()
        self._newest: tuple[int, DisplayView] | None = None
        self._drawing = threading.Lock()
        self._top_view: tuple[int, bytes, dict[str, Any]] | None = None

    @property
    def sequence(self) -> int:
        """Number of the newest view; 0 = none yet."""
        newest = self._newest
        return newest[0] if newest is not None else self._saved()

    def newest(self) -> tuple[int, DisplayView] | None:
        """The newest view and its number; of a mission that has ended, the last one, from its file."""
        newest = self._newest
        if newest is not None:
            return newest
        saved = self._saved()
        stored = load_view(self._file) if saved else None
        return (saved, stored) if stored is not None else None

    def picture(self, kind: str) -> Picture | None:
        """An image of the newest view; None when there is no view."""
        newest = self.newest()
        return picture_of(newest[1], newest[0], kind) if newest is not None else None

    def top_view(self) -> tuple[int, bytes, dict[str, Any]] | None:
        """The newest map from above as a PNG, after the view's number and before what belongs over it; drawn
        once for all who look. None when there is no view."""
        newest = self.newest()
        if newest is None:
            return None
        with self._drawing:
            if self._top_view is None or self._top_view[0] != newest[0]:
                drawn = top_view(newest[1], below_m=self.moments.below_m)
                self._top_view = (newest[0], drawn.png(), top_view_facts(newest[1], drawn))
            return self._top_view

    def begin(self) -> None:
        """A process begins, which numbers its views from 1."""
        self._before = self._saved()

    def take(self, sequence: int, view: DisplayView, *, is_news: bool) -> None:
        """A view of the process; one that is no news is of a time whose moments are kept already."""
        self._newest = (self._before + sequence, view)
        if is_news:
            self._recorder.take_view(view)

    def take_figures(self, event: dict[str, Any]) -> None:
        """A numbered `telemetry` event, which belongs to a moment."""
        self._recorder.take_figures(event)

    def keep(self) -> int:
        """Write the last view down: missions may be many. Its number, or 0 when there is none."""
        if self._newest is None:
            return 0
        sequence, view = self._newest
        self._recorder.finish(view)
        try:
            save_view(view, self._file)
        except OSError as error:  # a full disk must not keep a mission from ending
            log.warning("a mission's last view could not be kept in %s: %s", self._file, error)
            return 0
        return sequence

    def let_go(self) -> None:
        """From now on the view comes from its file."""
        self._newest = None
