"""The folder that a run leaves behind: whole, or not there."""

from __future__ import annotations

import fcntl
import json
import math
import shutil
import threading
import time
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from hgs_core.errors import ConfigError
from hgs_core.mapping.keyframes import WORKING_FOLDER
from hgs_core.mission.events import MissionEvent, MissionObserver, MissionView
from hgs_core.mission.repeats import NO_REPEATS, Repeats

PARTIAL_SUFFIX: Final = ".partial"
_LOCK: Final = "lock"
_CHECKPOINTS: Final = "checkpoint"
_STILL_ENDING_S: Final = 60.0
"""How long to wait for a process that still works in the folder: one that lost its service saves and ends."""
_POLL_S: Final = 0.1


class RunFolder:
    """Work happens in `NAME.partial`; `complete()` renames it to `NAME`. A context manager: the folder is
    locked, and a process that ends in any way lets go of it.
    """

    def __init__(self, out: Path, *, is_new: bool) -> None:
        """See `new` and `take_up`."""
        self.out = out
        self.partial = partial_of(out)
        self.is_new = is_new
        self.partial.mkdir(parents=True, exist_ok=not is_new)
        self._lock = (self.partial / _LOCK).open("ab")
        self._wait_for_lock()

    @staticmethod
    def new(out: Path) -> RunFolder:
        """Raises `ConfigError` when `NAME` is there already, as results are never overwritten, or
        `NAME.partial`."""
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise ConfigError(f"{out} exists already: choose another folder or remove it first")
        if partial_of(out).exists():
            raise ConfigError(
                f"{partial_of(out)} is left from a run that was killed: go on from it with "
                f"`hgs resume {out}`, or remove it"
            )
        return RunFolder(out, is_new=True)

    @staticmethod
    def take_up(out: Path) -> RunFolder | None:
        """What a process that was killed or suspended left, or a new folder where it left nothing; None when
        the run turns out to be complete.

        Waits for a process that still works there, and raises `ConfigError` if it does not end.
        """
        if is_complete(out):
            _tidy(out)
            return None
        folder = RunFolder(out, is_new=not partial_of(out).exists())
        if folder.partial.exists():
            return folder
        # The process that was waited for has completed or discarded it.
        folder._lock.close()
        return None if is_complete(out) else RunFolder(out, is_new=True)

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.close()

    @property
    def keyframes(self) -> Path:
        return self.partial / "keyframes"

    @property
    def checkpoints(self) -> Path:
        return self.partial / _CHECKPOINTS

    @property
    def events(self) -> Path:
        return self.partial / "events.jsonl"

    def complete(self) -> None:
        """Give the folder its name, then remove what only an unfinished run needs: never the other way round,
        or a run killed meanwhile could not be gone on with."""
        if self.out.exists():
            self.out.rmdir()
        self.partial.rename(self.out)
        _tidy(self.out)

    def clear(self) -> None:
        """Remove all but what has been told: the run starts again."""
        for path in self.partial.iterdir():
            if path.is_dir():
                shutil.rmtree(path)
            elif path.name not in (_LOCK, self.events.name):
                path.unlink()

    def remove_keyframes_except(self, names: Collection[str]) -> None:
        """Remove images of keyframes that are not among `names` (paths below the folder)."""
        for path in self.keyframes.rglob("*"):
            if path.is_file() and path.relative_to(self.partial).as_posix() not in names:
                path.unlink()

    def discard(self) -> None:
        """Remove a run that failed before it had anything to show."""
        shutil.rmtree(self.partial)

    def _wait_for_lock(self) -> None:
        deadline = time.monotonic() + _STILL_ENDING_S
        while True:
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() >= deadline:
                    self._lock.close()
                    raise ConfigError(f"another process works in {self.partial}: end it first") from None
                time.sleep(_POLL_S)
            else:
                return


def partial_of(out: Path) -> Path:
    """Where a run works as long as it is not complete."""
    return out.with_name(f"{out.name}{PARTIAL_SUFFIX}")


def is_complete(out: Path) -> bool:
    """Whether a run has come to its end and has its name."""
    return (out / "report.json").is_file()


def _tidy(out: Path) -> None:
    """Remove what only an unfinished run needs."""
    (out / _LOCK).unlink(missing_ok=True)
    for folder in (out / _CHECKPOINTS, out / "keyframes" / WORKING_FOLDER):
        shutil.rmtree(folder, ignore_errors=True)


class EventLog:
    """Writes every event as one JSON line and passes it on. What is in the file already stays, and events
    that tell the same again are not written a second time. Safe to use from any thread.

    Lines that do not fit on a full disk wait, and are written before the next one that does.
    """

    def __init__(self, path: Path, then: MissionObserver) -> None:
        self._file = path.open("r+b" if path.exists() else "w+b", buffering=0)
        self._then = then
        self._writing = threading.Lock()
        self._repeats = NO_REPEATS
        self._from_s = -math.inf
        self._end = _end_of_whole_lines(path.read_bytes())
        self._file.truncate(self._end)  # what follows was torn when a process or the power was lost
        self._waiting: list[bytes] = []

    def go_on_from(self, time_s: float) -> None:
        """What was told of this moment and later ones comes again."""
        self._file.seek(0)
        told = (json.loads(line) for line in self._file.read(self._end).splitlines())
        self._repeats = Repeats.after(time_s, told)
        self._from_s = time_s

    def on_event(self, event: MissionEvent) -> None:
        if event.time_s < self._from_s:  # what a process does before it has come to where it goes on
            event = replace(event, time_s=self._from_s)
        line = finite(event.as_json())
        with self._writing:
            if not self._repeats.holds(line):
                self._waiting.append(json.dumps(line, separators=(",", ":")).encode() + b"\n")
                self._write()
        self._then.on_event(event)

    def wants_view(self) -> bool:
        return self._then.wants_view()

    def on_view(self, view: MissionView) -> None:
        self._then.on_view(view)

    def close(self) -> None:
        with self._writing:
            self._file.close()

    def _write(self) -> None:
        if self._file.closed:  # STOP may come while the last words are said
            return
        content = b"".join(self._waiting)
        try:
            self._file.seek(self._end)
            written = self._file.write(content)
            if written != len(content):
                raise OSError(f"{written} of {len(content)} bytes fit on the disk")
        except OSError:
            # The robot goes on; whether there is room for a mission at all is watched elsewhere (`DiskRoom`).
            return
        self._end += len(content)
        self._waiting.clear()


def _end_of_whole_lines(content: bytes) -> int:
    """How many bytes at the beginning of `content` are whole events, one a line."""
    end = 0
    for line in content.splitlines(keepends=True):
        try:
            whole = line.endswith(b"\n") and isinstance(json.loads(line), Mapping)
        except ValueError:
            whole = False
        if not whole:
            break
        end += len(line)
    return end


def finite(value: Any) -> Any:
    """JSON has no NaN: figures that were not measured become null."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return value
