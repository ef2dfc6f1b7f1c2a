"""Many files as one ZIP, made while it is sent: no copy on the disk, and no more in memory than a piece."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

_PIECE: Final = 256 * 1024


class _Outbox:
    """What `zipfile` writes to: a place without a way back, emptied after every piece."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def write(self, content: bytes) -> int:
        self._waiting += content
        return len(content)

    def flush(self) -> None:
        """Nothing to do: `take` hands out what waits."""

    def take(self) -> bytes:
        taken = bytes(self._waiting)
        self._waiting.clear()
        return taken


def zipped(files: Mapping[str, Path | bytes], *, compressed: bool = False) -> Iterator[bytes]:
    """A ZIP of `files` (or contents), names inside by key. Stored unless `compressed`: maps and images hardly
    shrink, and time is dearer.

    A file that vanishes before its turn is left out; one that grows meanwhile comes as far as it is then.
    """
    outbox, method = _Outbox(), zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(outbox, "w", method) as archive:  # type: ignore[call-overload]
        for name, path in files.items():
            if isinstance(path, bytes):
                archive.writestr(name, path)
                yield outbox.take()
                continue
            try:
                source = path.open("rb")
            except FileNotFoundError:
                continue
            about = zipfile.ZipInfo.from_file(path, name, strict_timestamps=False)
            about.compress_type = method
            with source, archive.open(about, "w", force_zip64=True) as entry:
                while piece := source.read(_PIECE):
                    entry.write(piece)
                    yield outbox.take()
    yield outbox.take()
