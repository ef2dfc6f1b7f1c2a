"""How a mission process and the service exchange data.

- `ArraySlot`: arrays, newest wins, through double-buffered shared memory. A reader never sees a torn set.
- `EventSender`: small events through a pipe, in order; under pressure telemetry is dropped, nothing else.
- `CommandReceiver`: operator commands through a pipe; STOP and SUSPEND overtake whatever waits before them.
"""

from __future__ import annotations

import json
import math
import struct
import threading
import zlib
from collections import deque
from collections.abc import Mapping
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from multiprocessing.shared_memory import SharedMemory
from typing import Any, Final

import numpy as np
from numpy import ndarray

from app.errors import ServiceError

_LATEST: Final = struct.Struct("<Q")
_GUARD: Final = struct.Struct("<QQQI")
"""Of each buffer: sequence when writing began, sequence when it ended, payload bytes, CRC-32."""
_HEAD: Final = 64
_ALIGN: Final = 16


class TransportError(ServiceError):
    """Arrays do not fit their slot, or the slot is not what was expected."""


class ArraySlot:
    """The newest set of named arrays, shared by one writer and any number of readers.

    Two buffers take turns. The writer marks a buffer before and after it fills it and publishes its sequence
    last; a reader copies a buffer and takes the copy only when both marks and the checksum agree with that
    sequence. So a reader gets a whole set or none, even when the writer laps it.
    """

    def __init__(self, memory: SharedMemory, *, owner: bool) -> None:
        self._memory = memory
        self._owner = owner
        self._stride = (memory.size - _HEAD) // 2 // _ALIGN * _ALIGN

    @staticmethod
    def create(capacity_bytes: int) -> ArraySlot:
        """A new, empty slot whose sets may hold `capacity_bytes` in all. The creator unlinks it."""
        size = _HEAD + 2 * _aligned(_aligned(_GUARD.size) + capacity_bytes)
        memory = SharedMemory(create=True, size=size)
        _buffer(memory)[:_HEAD] = bytes(_HEAD)
        return ArraySlot(memory, owner=True)

    @staticmethod
    def attach(name: str) -> ArraySlot:
        return ArraySlot(SharedMemory(name=name), owner=False)

    @property
    def name(self) -> str:
        return self._memory.name

    @property
    def capacity_bytes(self) -> int:
        return self._stride - _aligned(_GUARD.size)

    @property
    def latest(self) -> int:
        """Sequence of the newest set; 0 = none yet."""
        return int(_LATEST.unpack_from(_buffer(self._memory), 0)[0])

    def write(self, arrays: Mapping[str, ndarray], meta: Mapping[str, Any]) -> int:
        """Publish a set and return its sequence. Raises `TransportError` when it does not fit."""
        header, total = _layout(arrays, meta)
        if total > self.capacity_bytes:
            raise TransportError(f"a set of {total} bytes does not fit the slot's {self.capacity_bytes}")
        sequence = self.latest + 1
        memory = _buffer(self._memory)
        start = self._start(sequence)
        payload = start + _aligned(_GUARD.size)
        _GUARD.pack_into(memory, start, sequence, 0, 0, 0)
        memory[payload : payload + 4] = len(header).to_bytes(4, "little")
        memory[payload + 4 : payload + 4 + len(header)] = header
        offset = payload + _aligned(4 + len(header))
        for array in arrays.values():
            plain = np.ascontiguousarray(array)
            target = np.frombuffer(memory, np.uint8, plain.nbytes, offset)
            target[:] = plain.reshape(-1).view(np.uint8)
            offset = _aligned(offset - payload + plain.nbytes) + payload
        checksum = zlib.crc32(memory[payload : payload + total])
        _GUARD.pack_into(memory, start, sequence, sequence, total, checksum)
        _LATEST.pack_into(memory, 0, sequence)
        return sequence

    def read(self, after: int = 0) -> tuple[int, dict[str, ndarray], dict[str, Any]] | None:
        """The newest whole set with a sequence above `after`, as a copy; None when there is none."""
        memory = _buffer(self._memory)
        for _ in range(64):
            sequence = self.latest
            if sequence <= after:
                return None
            start = self._start(sequence)
            began, ended, total, checksum = _GUARD.unpack_from(memory, start)
            if began != sequence or ended != sequence or total > self.capacity_bytes:
                continue
            payload = start + _aligned(_GUARD.size)
            copied = bytes(memory[payload : payload + total])
            if _GUARD.unpack_from(memory, start)[0] == sequence and zlib.crc32(copied) == checksum:
                arrays, meta = _parse(copied)
                return sequence, arrays, meta
        return None

    def close(self) -> None:
        self._memory.close()
        if self._owner:
            self._memory.unlink()

    def _start(self, sequence: int) -> int:
        return _HEAD + (sequence % 2) * self._stride


class EventSender:
    """Sends events from a thread of its own, so that the mission's loop never waits for the service.

    At most `limit` events wait; when more come, the oldest telemetry goes first, and an event that is not
    telemetry is never dropped. How many were is told as soon as the service listens again.
    """

    def __init__(self, connection: Connection, *, limit: int = 512) -> None:
        self._connection = connection
        self._limit = limit
        self._waiting: deque[dict[str, Any]] = deque()
        self._changed = threading.Condition()
        self._dropped = 0
        self._closing = False
        self._broken = False
        self._thread = threading.Thread(target=self._run, name="event-sender", daemon=True)
        self._thread.start()

    def send(self, event: dict[str, Any]) -> None:
        with self._changed:
            if self._broken:
                return
            if len(self._waiting) >= self._limit:
                self._drop_one_telemetry()
            self._waiting.append(event)
            self._changed.notify()

    def close(self, timeout_s: float = 5.0) -> None:
        """Send what waits, then close the pipe."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(timeout_s)
        self._connection.close()

    def _drop_one_telemetry(self) -> None:
        for position, event in enumerate(self._waiting):
            if event.get("kind") == "telemetry":
                del self._waiting[position]
                self._dropped += 1
                return

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._waiting) or self._closing)
                if not self._waiting:
                    return
                if self._dropped:
                    event, self._dropped = {"control": "dropped", "events": self._dropped}, 0
                else:
                    event = self._waiting.popleft()
            try:
                self._connection.send_bytes(json.dumps(event, allow_nan=False).encode())
            except OSError:  # the service has gone: the watcher of the parent ends this process
                with self._changed:
                    self._broken = True
                    self._waiting.clear()
                return


class CommandReceiver:
    """Orders of the operator as texts (`hgs_core.mission.commands`), each handed out once.

    STOP overtakes whatever waits before it, and nothing comes after it: callers may poll until there is
    nothing left. Likewise SUSPEND, after which only STOP comes; a service that is gone means SUSPEND.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._waiting: deque[str] = deque()
        self._lock = threading.Lock()
        self._stop_wanted = False
        self._stop_handed_out = False
        self._gone = False
        self._suspend_wanted = False
        self._suspend_handed_out = False
        # Whoever polls may have read STOP before the one who waits for it has woken: that one would sleep on.
        self._end_seen, self._tell_end = Pipe(duplex=False)
        self._end_told = False

    def suspend_now(self) -> None:
        """Let the next `poll` return suspend, whatever else but STOP the pipe holds."""
        with self._lock:
            self._suspend_wanted = True

    def wait_for_stop(self) -> bool:
        """Wait until STOP comes, whether or not anybody polls meanwhile; false when none can come."""
        while True:
            with self._lock:
                self._receive()
                if self._stop_wanted or self._gone:
                    return self._stop_wanted
            wait([self._connection, self._end_seen])

    def poll(self) -> str | None:
        with self._lock:
            if self._stop_handed_out:
                return None
            self._receive()
            if self._stop_wanted:
                self._stop_handed_out = True
                return "stop"
            if self._suspend_handed_out:
                return None
            if self._suspend_wanted:
                self._suspend_handed_out = True
                return "suspend"
            return self._waiting.popleft() if self._waiting else None

    def _receive(self) -> None:
        try:
            while not self._stop_wanted and self._connection.poll(0):
                self._waiting.append(self._connection.recv_bytes().decode())
        except (EOFError, OSError):  # the service has gone
            self._gone = True
            self._suspend_wanted = True
        self._stop_wanted |= "stop" in self._waiting
        self._suspend_wanted |= "suspend" in self._waiting
        if (self._stop_wanted or self._gone) and not self._end_told:
            self._end_told = True
            self._tell_end.send_bytes(b"end")


def plain_json(value: Any) -> Any:
    """`value` with only what strict JSON can say: no NaN or infinity (None instead), no NumPy scalars."""
    if isinstance(value, Mapping):
        return {str(key): plain_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(entry) for entry in value]
    if isinstance(value, ndarray):
        return plain_json(value.tolist())
    if isinstance(value, np.generic):
        return plain_json(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, str | int | bool) or value is None:
        return value
    return str(value)


def _layout(arrays: Mapping[str, ndarray], meta: Mapping[str, Any]) -> tuple[bytes, int]:
    entries = [[name, array.dtype.str, list(array.shape)] for name, array in arrays.items()]
    header = json.dumps({"meta": meta, "arrays": entries}).encode()
    total = _aligned(4 + len(header)) + sum(_aligned(array.nbytes) for array in arrays.values())
    return header, total


def _parse(payload: bytes) -> tuple[dict[str, ndarray], dict[str, Any]]:
    length = int.from_bytes(payload[:4], "little")
    header = json.loads(payload[4 : 4 + length])
    offset = _aligned(4 + length)
    arrays: dict[str, ndarray] = {}
    for name, dtype, shape in header["arrays"]:
        count = math.prod(shape)
        arrays[name] = np.frombuffer(payload, np.dtype(dtype), count, offset).reshape(shape)
        offset = _aligned(offset + arrays[name].nbytes)
    return arrays, header["meta"]


def _aligned(size: int) -> int:
    return -(-size // _ALIGN) * _ALIGN


def _buffer(memory: SharedMemory) -> memoryview:
    buffer = memory.buf
    assert buffer is not None
    return buffer
