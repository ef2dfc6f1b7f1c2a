"""Whether there is room on the disk for a mission to go on."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class DiskRoom:
    """Watches the disk that a run's folder lies on.

    A mission that waits in time keeps what it has and can still write its results; one that runs into a full
    disk dies in the middle of a frame.
    """

    folder: Path
    least_free_bytes: int

    def why_wait(self) -> str | None:
        """Why the mission cannot go on now; None when it can."""
        free = shutil.disk_usage(self.folder).free
        if free >= self.least_free_bytes:
            return None
        mib = 2**20
        return (
            f"the disk of {self.folder} is full: {free // mib} MiB are free, "
            f"{self.least_free_bytes // mib} MiB are needed; it goes on by itself when there is room"
        )
