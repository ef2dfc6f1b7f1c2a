"""How much room missions' files take, and how much there is."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Collection
from pathlib import Path
from typing import Final, NamedTuple

LIGHT: Final = frozenset(
    {"report.json", "report.html", "config.yaml", "trajectory.txt", "events.jsonl", "process.log"}
)
"""What is kept of a mission when its large files go: to read what it did, not to look at its map."""


class Disk(NamedTuple):
    total: int
    free: int


class Space:
    """Sizes of the folders below `missions_dir`. Those of missions that have ended are measured once."""

    def __init__(self, missions_dir: Path) -> None:
        self._root = missions_dir
        self._settled: dict[str, int] = {}
        self.used_bytes = 0
        """Of all missions together, when they were last measured."""

    def disk(self) -> Disk:
        """Of the disk that missions lie on, as an ordinary user may fill it. Raises `OSError`."""
        place = self._root if self._root.exists() else self._root.parent
        usage = shutil.disk_usage(place)
        return Disk(total=usage.total, free=usage.free)

    def measure(self, changing: Collection[str]) -> dict[str, int]:
        """Bytes of every mission's folder, by id; those that are `changing` are measured anew."""
        names = {path.name for path in self._root.iterdir()} if self._root.is_dir() else set()
        for name in (self._settled.keys() - names) | set(changing):
            self._settled.pop(name, None)
        sizes = {}
        for name in names:
            if name not in self._settled:
                size = size_of(self._root / name)
                if name in changing:
                    sizes[name] = size
                    continue
                self._settled[name] = size
            sizes[name] = self._settled[name]
        self.used_bytes = sum(sizes.values())
        return sizes

    def remove(self, mission_id: str, *, keep: Collection[str]) -> int:
        """Remove a mission's files but those whose name is in `keep`; how many bytes became free.

        What cannot be removed stays, and counts as used.
        """
        folder = self._root / mission_id
        before = size_of(folder)
        for directory, _, files in os.walk(folder, topdown=False):
            place = Path(directory)
            may_keep = place in (folder, folder / "run")
            for name in files:
                if not (may_keep and name in keep):
                    with contextlib.suppress(OSError):
                        (place / name).unlink()
            with contextlib.suppress(OSError):  # of a folder where something is kept
                place.rmdir()
        after = size_of(folder)
        self._settled[mission_id] = after
        self.used_bytes -= before - after
        return before - after


def size_of(folder: Path) -> int:
    """Bytes on the disk of all files below `folder`; what vanishes meanwhile counts nothing."""
    total = 0
    for directory, _, files in os.walk(folder):
        for name in files:
            try:
                total += os.lstat(os.path.join(directory, name)).st_blocks * 512
            except OSError:
                continue
    return total
