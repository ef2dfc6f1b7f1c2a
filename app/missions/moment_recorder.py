"""Decides which views of a mission become moments, and brings each together with the figures of its frame."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from app.missions.display import DisplayView
from app.missions.moments import MomentArchive

log = logging.getLogger(__name__)


class MomentRecorder:
    """Called from the mission's thread alone.

    A frame's view mostly comes before its figures, and sometimes after: a moment has both.
    """

    def __init__(self, archive: MomentArchive, *, failed: Callable[[str, float], None]) -> None:
        """`failed(why, time_s)` is called once if the disk takes no more: that costs the timeline, and never
        the mission."""
        self._archive = archive
        self._failed = failed
        self._told = False
        self._waiting: DisplayView | None = None
        self._figures: dict[str, Any] | None = None

    def take_view(self, view: DisplayView) -> None:
        if self._archive.is_due(view.time_s):
            self._waiting = view
            self._record_if_complete()

    def take_figures(self, event: dict[str, Any]) -> None:
        """A numbered `telemetry` event."""
        self._figures = event
        self._record_if_complete()

    def finish(self, last: DisplayView) -> None:
        """The mission has ended: its last view is its last moment."""
        recorded = self._archive.all()
        if not recorded or recorded[-1].time_s != last.time_s:
            self._record(last)

    def _record_if_complete(self) -> None:
        if self._waiting is None or self._figures is None:
            return
        if self._figures["time_s"] >= self._waiting.time_s:
            self._record(self._waiting)

    def _record(self, view: DisplayView) -> None:
        self._waiting = None
        figures = self._figures or {"sequence": 0, "path_length_m": 0.0}
        try:
            self._archive.record(
                view, sequence=int(figures["sequence"]), path_length_m=float(figures["path_length_m"])
            )
        except OSError as error:
            log.warning("a moment could not be kept: %s", error)
            if not self._told:
                self._told = True
                self._failed(f"the timeline has gaps from here on: {error.strerror or error}", view.time_s)
