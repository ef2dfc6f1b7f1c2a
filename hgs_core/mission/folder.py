"""The folder that a run leaves behind: whole, or not there."""

from __future__ import annotations

import json
import math
import shutil
import threading
from pathlib import Path
from typing import IO, Any

from hgs_core.errors import ConfigError
from hgs_core.mission.events import MissionEvent, MissionObserver, MissionView


class RunFolder:
    """Work happens in `NAME.partial`; `complete()` renames it to `NAME`.

    Raises `ConfigError` when `NAME` or `NAME.partial` is there already: results are never overwritten.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.partial = out.with_name(f"{out.name}.partial")
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise ConfigError(f"{out} exists already: choose another folder or remove it first")
        if self.partial.exists():
            raise ConfigError(
                f"{self.partial} is left from a run that was killed: look at its events.jsonl, then remove it"
            )
        self.partial.mkdir(parents=True)

    @property
    def keyframes(self) -> Path:
        return self.partial / "keyframes"

    def complete(self) -> None:
        """Give the folder its name."""
        if self.out.exists():
            self.out.rmdir()
        self.partial.rename(self.out)

    def discard(self) -> None:
        """Remove a run that failed before it had anything to show."""
        shutil.rmtree(self.partial)


class EventLog:
    """Writes every event as one JSON line and passes it on. Safe to use from any thread."""

    def __init__(self, path: Path, then: MissionObserver) -> None:
        self._file: IO[str] = path.open("w", encoding="utf-8")
        self._then = then
        self._writing = threading.Lock()

    def on_event(self, event: MissionEvent) -> None:
        line = json.dumps(_finite(event.as_json()), separators=(",", ":")) + "\n"
        with self._writing:
            if not self._file.closed:  # STOP may come while the last words are said
                self._file.write(line)
                self._file.flush()
        self._then.on_event(event)

    def wants_view(self) -> bool:
        return self._then.wants_view()

    def on_view(self, view: MissionView) -> None:
        self._then.on_view(view)

    def close(self) -> None:
        with self._writing:
            self._file.close()


def _finite(value: Any) -> Any:
    """JSON has no NaN: figures that were not measured become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value
