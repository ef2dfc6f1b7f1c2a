import json

import pytest

from app.errors import Invalid
from app.missions import event_log
from app.missions.event_log import LIVE_TELEMETRY, EventLog


@pytest.fixture
def log(tmp_path):
    log = EventLog(tmp_path / "events.jsonl")
    yield log
    log.close()


def test_events_are_numbered_and_kept_in_order(log):
    for kind in ("state", "telemetry", "plan"):
        log.append({"kind": kind})
    assert [(e["sequence"], e["kind"]) for e in log.live(0)] == [(1, "state"), (2, "telemetry"), (3, "plan")]
    assert [e["sequence"] for e in log.live(1)] == [2, 3]
    assert log.live(3) == []
    assert log.newest("plan")["sequence"] == 3
    assert log.newest("ended") is None


def test_a_reader_that_fell_behind_gets_every_state_and_the_newest_telemetry(log):
    for number in range(1000):
        log.append({"kind": "state" if number % 100 == 0 else "telemetry", "number": number})
    events = log.live(0)
    assert [e["number"] for e in events if e["kind"] == "state"] == list(range(0, 1000, 100))
    telemetry = [e["number"] for e in events if e["kind"] == "telemetry"]
    assert telemetry == list(range(1000 - LIVE_TELEMETRY, 1000))
    assert [e["sequence"] for e in events] == sorted(e["sequence"] for e in events)


def test_states_pushed_out_of_memory_are_read_from_the_file(log, monkeypatch, tmp_path):
    monkeypatch.setattr(event_log, "OTHERS_KEPT", 10)
    small = EventLog(tmp_path / "small.jsonl")
    small._others = type(small._others)(maxlen=10)
    for number in range(50):
        small.append({"kind": "state", "number": number})
    assert [e["number"] for e in small.live(0)] == list(range(50))
    assert [e["number"] for e in small.live(45)] == list(range(45, 50))
    page, more = small.history(after=0, limit=50)
    assert [e["number"] for e in page] == list(range(50))
    assert not more
    small.close()


def test_history_pages_through_everything_once(log):
    for number in range(25):
        log.append({"kind": "plan" if number % 2 else "telemetry", "number": number})
    seen, after, more = [], 0, True
    while more:
        page, more = log.history(after=after, limit=4)
        seen += [e["number"] for e in page]
        after = page[-1]["sequence"]
    assert seen == list(range(25))
    plans, _ = log.history(kinds=["plan"], limit=100)
    assert [e["number"] for e in plans] == list(range(1, 25, 2))
    with pytest.raises(Invalid, match="limit"):
        log.history(limit=0)


def test_a_log_goes_on_where_it_ended_even_after_a_cut_off_line(tmp_path):
    path = tmp_path / "events.jsonl"
    first = EventLog(path)
    first.append({"kind": "state"})
    first.append({"kind": "plan"})
    first.close()
    with path.open("a") as file:
        file.write('{"sequence": 3, "kin')  # the service was killed here
    second = EventLog(path)
    assert second.last_sequence == 2
    second.append({"kind": "notice"})
    second.close()
    assert [json.loads(line)["kind"] for line in path.read_text().splitlines()] == ["state", "plan", "notice"]


def test_readers_are_woken_until_they_leave(log):
    woken = []
    wake = lambda: woken.append(1)  # noqa: E731
    log.add_waker(wake)
    log.append({"kind": "state"})
    log.remove_waker(wake)
    log.append({"kind": "state"})
    assert woken == [1]


def test_a_closed_log_can_be_read(log):
    log.append({"kind": "state"})
    log.close()
    assert len(log.live(0)) == 1
