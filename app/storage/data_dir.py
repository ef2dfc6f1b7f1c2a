"""The data folder: one service at a time, and files that are written whole or not at all."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from hgs_core.errors import ConfigError


class DataDirLock:
    """Held as long as the service lives; the kernel lets go of it however the process ends."""

    def __init__(self, data_dir: Path) -> None:
        """Raises `ConfigError` when another service uses `data_dir`."""
        try:
            data_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._file = (data_dir / "service.lock").open("a+")
        except OSError as error:
            raise ConfigError(f"the data folder {data_dir} cannot be written: {error}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise ConfigError(
                f"another hgs service uses {data_dir}: end it, or name another folder with HGS_DATA_DIR"
            ) from None

    def release(self) -> None:
        self._file.close()


def write_whole(path: Path, write: Callable[[BinaryIO], None]) -> None:
    """Let `write` fill a file that takes the place of `path` once all of it lies on the disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.partial")
    try:
        with partial.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
