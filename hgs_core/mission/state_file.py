"""A state as one file: nested plain data and NumPy arrays, with a checksum for every part.

The file is an uncompressed or lightly compressed ZIP archive, as `numpy.savez` writes it: `state.json` holds
the plain data, in which `{"array": k}` stands for `k.npy`. A torn archive has no directory, which is at its
end; a changed byte does not agree with its part's CRC-32. Nothing in it can be executed.
"""

from __future__ import annotations

import contextlib
import json
import zipfile
import zlib
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy import ndarray

from hgs_core.errors import CheckpointError

_PLAIN: Final = "state.json"
_ARRAY: Final = "array"
_SLICE_BYTES: Final = 16 * 2**20
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Of every part: equal states make equal files."""
_DAMAGE: Final = (
    *(OSError, EOFError, KeyError, ValueError),
    *(zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError),
)
"""What the archive's reader raises for bytes that are not those that were written; RuntimeError where they
claim to be encrypted."""


class StateWriter:
    """Writes a state into an open file, part by part; it is worth something once `close` has come back."""

    def __init__(self, file: BinaryIO, *, compressed: bool = False) -> None:
        self._method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
        self._archive = zipfile.ZipFile(file, "w", self._method, compresslevel=1 if compressed else None)

    def write(self, state: Mapping[str, Any]) -> None:
        """Raises `CheckpointError` for what is neither plain data nor an array of numbers."""
        arrays: list[ndarray] = []
        self.write_part(_PLAIN, json.dumps(_plain(state, arrays, "state"), separators=(",", ":")).encode())
        for number, array in enumerate(arrays):
            head = BytesIO()
            np.lib.format.write_array_header_1_0(head, np.lib.format.header_data_from_array_1_0(array))
            self.write_part(f"{number}.npy", head.getvalue(), array)

    def write_part(self, name: str, head: bytes, array: ndarray | None = None) -> None:
        """`head`, then the array's bytes, without a copy of them."""
        info = zipfile.ZipInfo(name, _EPOCH)
        info.compress_type = self._method
        with self._archive.open(info, "w", force_zip64=True) as part:
            part.write(head)
            if array is not None and array.size:
                content: memoryview = array.reshape(-1).view(np.uint8).data
                for begin in range(0, len(content), _SLICE_BYTES):
                    part.write(content[begin : begin + _SLICE_BYTES])

    def close(self) -> None:
        """Write the directory."""
        self._archive.close()

    def abandon(self) -> None:
        """Let go of the file, whose content is worth nothing."""
        with contextlib.suppress(OSError, ValueError):
            self._archive.close()


def read_state(path: Path) -> dict[str, Any]:
    """The state in `path`; its arrays cannot be written to. Raises `CheckpointError` for a file that is torn,
    damaged, or not one of these."""
    try:
        with zipfile.ZipFile(path) as archive:
            plain = json.loads(archive.read(_PLAIN))
            state = _restored(plain, lambda number: _array(archive.read(f"{number}.npy")))
    except _DAMAGE as error:
        raise CheckpointError(f"{path} is torn or damaged: {error}") from error
    if not isinstance(state, dict):
        raise CheckpointError(f"{path} holds no state")
    return state


def read_part(path: Path, name: str) -> bytes:
    """A part written beside the state. Raises `CheckpointError` likewise."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.read(name)
    except _DAMAGE as error:
        raise CheckpointError(f"{path} is torn or damaged: {error}") from error


def _plain(value: Any, arrays: list[ndarray], place: str) -> Any:
    """`value` for JSON, with what is an array moved to `arrays`."""
    if isinstance(value, ndarray) and value.dtype.kind in "biuf":
        arrays.append(np.ascontiguousarray(value))
        return {_ARRAY: len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping) and all(isinstance(key, str) and key != _ARRAY for key in value):
        return {key: _plain(entry, arrays, f"{place}.{key}") for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry, arrays, f"{place}[{k}]") for k, entry in enumerate(value)]
    if isinstance(value, str | int | float) or value is None:
        return value
    raise CheckpointError(
        f"{place} is a {type(value).__name__}, which cannot be saved: states are dictionaries with texts as "
        "keys, lists, texts, numbers and arrays of numbers"
    )


def _restored(value: Any, array: Any) -> Any:
    if isinstance(value, dict):
        if value.keys() == {_ARRAY}:
            return array(value[_ARRAY])
        return {key: _restored(entry, array) for key, entry in value.items()}
    if isinstance(value, list):
        return [_restored(entry, array) for entry in value]
    return value


def _array(content: bytes) -> ndarray:
    head = BytesIO(content)
    version = np.lib.format.read_magic(head)
    if version != (1, 0):
        raise ValueError(f"an array of format {version}")
    shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(head)
    if fortran_order or dtype.hasobject:
        raise ValueError("an array of another layout")
    return np.frombuffer(content, dtype, int(np.prod(shape)), head.tell()).reshape(shape)
