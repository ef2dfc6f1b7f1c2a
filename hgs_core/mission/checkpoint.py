"""Checkpoints: what another process needs to go on with a mission, on disk at a stated interval.

`checkpoint/NNNNNN.npz` of a run's unfinished folder is a state (`hgs_core.mission.state_file`) of everything
but what lies on disk anyway: keyframes' images are files that never change, of which it holds sizes and
checksums. The two newest are kept, so there is one to go on from whatever happens to the newest.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

from hgs_core.errors import CheckpointError
from hgs_core.mission.state_file import StateWriter, read_part, read_state

FORMAT: Final = 2
"""Raised whenever a state of before cannot be gone on from any more."""
_SEALS: Final = "files.json"
_KEPT: Final = 2

Seal = tuple[int, int]
"""Size [B] and CRC-32 of a file that a checkpoint refers to."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Checkpoint:
    """One that is whole, with all the files that it refers to."""

    path: Path
    state: dict[str, Any]
    files: frozenset[str]
    """Below the run's folder."""


class CheckpointFolder:
    """Writes checkpoints of one run, and finds the newest that is whole.

    `begin` copies the state to the file, which the mission waits for; a thread then sees that all of it and
    all that it refers to lies on the disk, and only then gives it its name: it is whole or not there.
    """

    def __init__(self, run: Path, folder: Path) -> None:
        self._run = run
        self._folder = folder
        self._seals: dict[str, Seal] = {}
        self._thread: threading.Thread | None = None
        self._error: OSError | None = None

    def newest(self) -> tuple[Checkpoint | None, list[str]]:
        """The newest that is whole, and what was wrong with newer ones.

        Raises `CheckpointError` for one of another format: it is whole, and of no use to this version.
        """
        complaints: list[str] = []
        for path in reversed(self._files()):
            try:
                return self._read(path), complaints
            except _OtherFormat:
                raise
            except CheckpointError as error:
                complaints.append(str(error))
        return None, complaints

    def go_on_from(self, checkpoint: Checkpoint) -> None:
        """Later ones are written on top of this one; newer ones, which are damaged, and those that were not
        finished are removed."""
        self._seals = _seals(checkpoint.path)
        for unfinished in self._folder.glob("*.partial"):
            unfinished.unlink()
        for path in self._files():
            if path > checkpoint.path:
                path.unlink()

    def begin(self, state: Mapping[str, Any], files: Sequence[Path]) -> int:
        """Write a checkpoint that refers to `files`, as far as the disk's cache. Returns its size [B].

        Raises `OSError` for a full disk, and leaves nothing then, and `CheckpointError` for a state that
        cannot be saved.
        """
        self.finish()
        self._folder.mkdir(exist_ok=True)
        number = max((_number(path) for path in self._files()), default=0) + 1
        path = self._folder / f"{number:06d}.npz"
        partial = path.with_suffix(".partial")
        file = partial.open("wb")
        writer = StateWriter(file)
        try:
            writer.write({"format": FORMAT, **state})
            size = file.tell()
        except BaseException:
            writer.abandon()
            partial.unlink(missing_ok=True)
            _close(file)
            raise

        def seal() -> None:
            try:
                self._seal(files)
                writer.write_part(_SEALS, json.dumps(self._seals).encode())
                writer.close()
                file.flush()
                os.fsync(file.fileno())
                partial.rename(path)
                _flush_folder(self._folder)
                for old in self._files()[:-_KEPT]:
                    old.unlink()
            except OSError as error:
                self._error = error
                writer.abandon()
                partial.unlink(missing_ok=True)
            finally:
                _close(file)

        self._thread = threading.Thread(target=seal, name="checkpoint")
        self._thread.start()
        return size

    @property
    def busy(self) -> bool:
        """Whether one is still being brought to the disk."""
        return self._thread is not None and self._thread.is_alive()

    def finish(self) -> None:
        """Wait for what is under way. Raises `OSError` where it could not be brought to the disk."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        error, self._error = self._error, None
        if error is not None:
            raise error

    def make_room(self) -> bool:
        """Remove the oldest where there are two; whether there were."""
        self.finish()
        *older, _ = self._files() or [self._folder]
        for path in older:
            path.unlink()
        return bool(older)

    def _seal(self, files: Sequence[Path]) -> None:
        """Bring the files to the disk that no checkpoint has referred to yet, and note their checksums."""
        seals: dict[str, Seal] = {}
        folders: set[Path] = set()
        for path in files:
            name = path.relative_to(self._run).as_posix()
            if name not in self._seals:
                with path.open("rb") as file:
                    seals[name] = _seal_of(file.read())
                    os.fsync(file.fileno())
                folders.add(path.parent)
        for folder in folders:
            _flush_folder(folder)
        self._seals |= seals

    def _read(self, path: Path) -> Checkpoint:
        state = read_state(path)
        if state.get("format") != FORMAT:
            raise _OtherFormat(
                f"{path} has format {state.get('format')}, this version of hgs reads format {FORMAT}: "
                "go on with the version that wrote it"
            )
        seals = _seals(path)
        for name, seal in seals.items():
            try:
                found = _seal_of((self._run / name).read_bytes())
            except OSError as error:
                raise CheckpointError(f"{path} refers to {name}, which cannot be read: {error}") from error
            if found != seal:
                raise CheckpointError(f"{path} refers to {name}, which is torn or damaged")
        return Checkpoint(path=path, state=state, files=frozenset(seals))

    def _files(self) -> list[Path]:
        """Those that have their name, oldest first."""
        return sorted(self._folder.glob("[0-9]*.npz"))


class _OtherFormat(CheckpointError):
    """Written by another version."""


def _seals(path: Path) -> dict[str, Seal]:
    return {name: (int(size), int(crc)) for name, (size, crc) in json.loads(read_part(path, _SEALS)).items()}


def _seal_of(content: bytes) -> Seal:
    return len(content), zlib.crc32(content)


def _number(path: Path) -> int:
    return int(path.stem)


def _flush_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _close(file: BinaryIO) -> None:
    """Closing writes what is buffered still, which a full disk does not take."""
    with contextlib.suppress(OSError):
        file.close()
