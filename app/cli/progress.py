"""What `hgs run` shows while a mission runs."""

from __future__ import annotations

import math
import time
from types import TracebackType
from typing import Final, Self

from rich.console import Console, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from hgs_core.mission.events import (
    MissionEvent,
    MissionPhase,
    MissionView,
    Notice,
    PhaseChanged,
    PlanMade,
    Telemetry,
)

_REFRESH_HZ: Final = 4
_LINE_EVERY_S: Final = 10.0
"""Wall time between lines where there is no terminal to draw on."""
_NOTICE_STYLES: Final = {"warning": "yellow", "error": "red"}


class MissionProgress:
    """A `MissionObserver` that keeps a small table up to date; plain lines where output is not a terminal.

    Used as a context manager around the mission.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._phase = MissionPhase.PREPARING
        self._doing = "starting"
        self._telemetry: Telemetry | None = None
        self._plans = 0
        self._last_line_s = -math.inf
        self._live = Live(get_renderable=self._table, console=console, refresh_per_second=_REFRESH_HZ)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start(refresh=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def say(self, message: str, style: str = "yellow") -> None:
        """A line above the table."""
        self._console.print(Text(message, style=style))

    def on_event(self, event: MissionEvent) -> None:
        match event:
            case PhaseChanged():
                entered = event.phase is not self._phase
                self._phase, self._doing = event.phase, event.reason
                self._line(force=entered)
            case PlanMade():
                self._plans += 1
                self._doing = event.reason
            case Telemetry():
                self._telemetry = event
                self._line(force=False)
            case Notice():
                self.say(f"{event.level}: {event.message}", _NOTICE_STYLES.get(event.level, ""))
            case _:
                pass

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None:
        """Never asked for."""

    def _line(self, *, force: bool) -> None:
        now = time.monotonic()
        if self._console.is_terminal or not (force or now - self._last_line_s >= _LINE_EVERY_S):
            return
        self._last_line_s = now
        figures = "  ".join(f"{name} {value}" for name, value in self._figures())
        self._console.print(
            Text(f"{self._phase}: {self._doing}" + (f"  [{figures}]" if figures else "")), soft_wrap=True
        )

    def _figures(self) -> list[tuple[str, str]]:
        now = self._telemetry
        if now is None:
            return []
        return [
            ("time", f"{now.time_s:.1f} s"),
            ("path", f"{now.path_length_m:.1f} m"),
            ("frames", str(now.frame + 1)),
            ("plans", str(self._plans)),
            ("Gaussians", f"{now.n_gaussians:,}"),
            ("observed", f"{now.observed_volume_m3:.1f} m³"),
            ("missing", f"{now.missing_volume_m3:.2f} m³"),
            ("PSNR", f"{now.psnr_current_db:.1f} dB" if math.isfinite(now.psnr_current_db) else "-"),
            ("wall", f"{now.wall_s:.0f} s"),
        ]

    def _table(self) -> RenderableType:
        table = Table.grid(padding=(0, 2))
        figures = self._figures()
        table.add_row(*(Text(name, style="dim") for name, _ in figures))
        table.add_row(*(Text(value, style="bold") for _, value in figures))
        whole = Table.grid()
        whole.add_row(Text.assemble((f"{self._phase}", "bold cyan"), ": ", self._doing))
        if figures:
            whole.add_row(table)
        return whole
