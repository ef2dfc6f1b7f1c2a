import json
import multiprocessing
import threading
import time

import numpy as np
import pytest

from app.missions.transport import ArraySlot, CommandReceiver, EventSender, TransportError, plain_json


@pytest.fixture
def slot():
    slot = ArraySlot.create(1_000_000)
    yield slot
    slot.close()


def test_what_is_written_is_read(slot):
    arrays = {
        "floats": np.arange(12, dtype=np.float32).reshape(3, 4),
        "bytes": np.array([1, 2, 3], np.uint8),
        "none": np.zeros((0, 3), np.float32),
        "strided": np.arange(20).reshape(4, 5)[:, ::2],
    }
    assert slot.read() is None
    assert slot.write(arrays, {"time_s": 1.5}) == 1
    sequence, found, meta = slot.read()
    assert sequence == 1
    assert meta == {"time_s": 1.5}
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array)
    assert slot.read(after=1) is None


def test_a_copy_stays_when_the_writer_goes_on(slot):
    slot.write({"a": np.full(100, 1)}, {})
    _, found, _ = slot.read()
    for value in (2, 3, 4):
        slot.write({"a": np.full(100, value)}, {})
    assert np.all(found["a"] == 1)


def test_a_set_that_does_not_fit_is_refused_and_the_old_one_stays(slot):
    slot.write({"a": np.ones(10)}, {})
    with pytest.raises(TransportError, match="does not fit"):
        slot.write({"a": np.ones(1_000_000)}, {})
    assert slot.read()[0] == 1


def _write_for_ever(name: str, ready, stop) -> None:
    slot = ArraySlot.attach(name)
    value = 0
    while not stop.is_set():
        value += 1
        # Every element carries the same value, spread over arrays and the header: a mixture would show.
        slot.write({"a": np.full(50_000, value), "b": np.full(7 * (value % 50), value)}, {"value": value})
        ready.set()
    slot.close()


def test_no_set_is_ever_torn_while_another_process_writes_as_fast_as_it_can(slot):
    context = multiprocessing.get_context("spawn")
    ready, stop = context.Event(), context.Event()
    writer = context.Process(target=_write_for_ever, args=(slot.name, ready, stop), daemon=True)
    writer.start()
    assert ready.wait(60)
    seen = []
    deadline = time.monotonic() + 60
    while len(seen) < 300 and time.monotonic() < deadline:
        found = slot.read(after=seen[-1] if seen else 0)
        if found is None:
            continue
        sequence, arrays, meta = found
        assert meta["value"] == sequence
        assert np.all(arrays["a"] == sequence)
        assert len(arrays["b"]) == 7 * (sequence % 50)
        assert np.all(arrays["b"] == sequence)
        seen.append(sequence)
    stop.set()
    writer.join(30)
    assert len(seen) == 300
    assert seen == sorted(set(seen))


def test_a_damaged_set_is_not_read(slot):
    slot.write({"a": np.ones(10)}, {})
    slot.write({"a": np.full(10, 2.0)}, {})
    memory = slot._memory.buf
    start = slot._start(2)
    memory[start + 112] ^= 0xFF  # a byte of the payload, behind marks that say that it is whole
    assert slot.read() is None


def test_telemetry_is_dropped_first_and_nothing_else():
    reader, writer = multiprocessing.Pipe(duplex=False)
    blocked = threading.Event()

    class SlowConnection:
        def send_bytes(self, data: bytes) -> None:
            blocked.wait()
            writer.send_bytes(data)

        def close(self) -> None:
            writer.close()

    sender = EventSender(SlowConnection(), limit=10)
    for number in range(100):
        kind = "state" if number % 10 == 0 else "telemetry"
        sender.send({"kind": kind, "number": number})
    blocked.set()
    received = []

    def receive() -> None:
        try:
            while True:
                received.append(json.loads(reader.recv_bytes()))
        except EOFError:
            return

    thread = threading.Thread(target=receive)
    thread.start()
    sender.close()
    thread.join(10)
    events = [e for e in received if "kind" in e]
    assert [e["number"] for e in events if e["kind"] == "state"] == list(range(0, 100, 10))
    numbers = [e["number"] for e in events]
    assert numbers == sorted(numbers)
    assert len(numbers) < 25
    # What is missing is told, at once when the pipe flows again.
    assert sum(e["events"] for e in received if e.get("control") == "dropped") == 100 - len(numbers)


def test_stop_overtakes_what_waits_and_is_handed_out_once():
    reader, writer = multiprocessing.Pipe(duplex=False)
    receiver = CommandReceiver(reader)
    assert receiver.poll() is None
    writer.send_bytes(b"pause")
    assert receiver.poll() == "pause"
    for word in (b"resume", b"pause", b"stop"):
        writer.send_bytes(word)
    assert receiver.poll() == "stop"
    writer.send_bytes(b"resume")
    assert receiver.poll() is None  # a caller that polls until nothing is left must come to an end
    receiver.suspend_now()
    assert receiver.poll() is None


def test_after_suspend_comes_stop_alone():
    reader, writer = multiprocessing.Pipe(duplex=False)
    receiver = CommandReceiver(reader)
    for word in (b"pause", b"suspend", b"resume"):
        writer.send_bytes(word)
    assert receiver.poll() == "suspend"
    assert receiver.poll() is None
    writer.send_bytes(b"stop")
    assert receiver.poll() == "stop"
    assert receiver.poll() is None


def test_losing_the_service_means_suspend():
    reader, writer = multiprocessing.Pipe(duplex=False)
    receiver = CommandReceiver(reader)
    writer.close()
    assert receiver.poll() == "suspend"
    assert receiver.poll() is None


def test_plain_json_has_no_numbers_that_json_cannot_say():
    value = {
        "nan": float("nan"),
        "inf": np.float32(np.inf),
        "ok": np.int64(3),
        "rows": (1.5, [np.bool_(True)]),
    }
    assert plain_json(value) == {"nan": None, "inf": None, "ok": 3, "rows": [1.5, [True]]}
    json.dumps(plain_json(value), allow_nan=False)


def test_stop_is_noticed_by_who_waits_for_it_and_still_handed_out_to_who_polls():
    reader, writer = multiprocessing.Pipe(duplex=False)
    receiver = CommandReceiver(reader)
    noticed = []
    waiter = threading.Thread(target=lambda: noticed.append(receiver.wait_for_stop()), daemon=True)
    waiter.start()
    writer.send_bytes(b"pause")
    writer.send_bytes(b"stop")
    waiter.join(30)
    assert noticed == [True]
    assert receiver.poll() == "stop"
    assert receiver.poll() is None


def test_who_waits_for_stop_learns_of_one_that_the_other_thread_has_read():
    """The pipe is empty again before the waiting thread has woken, so nothing in it will wake it."""
    reader, _writer = multiprocessing.Pipe(duplex=False)
    receiver = CommandReceiver(reader)
    noticed = []
    waiter = threading.Thread(target=lambda: noticed.append(receiver.wait_for_stop()), daemon=True)
    waiter.start()
    receiver._waiting.append("stop")
    assert receiver.poll() == "stop"
    waiter.join(30)
    assert noticed == [True]


def test_who_waits_for_stop_is_not_left_waiting_when_the_service_goes():
    reader, writer = multiprocessing.Pipe(duplex=False)
    receiver = CommandReceiver(reader)
    waiter = threading.Thread(target=receiver.wait_for_stop, daemon=True)
    waiter.start()
    writer.close()
    waiter.join(30)
    assert not waiter.is_alive()
