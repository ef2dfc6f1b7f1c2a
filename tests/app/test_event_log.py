import pytest

from app.errors import Invalid
from app.missions import event_log
from app.missions.event_log import LIVE_TELEMETRY, OTHERS_KEPT, EventLog
from app.missions.states import MissionState
from app.storage.database import StorageError
from tests.app.databases import mission_record


@pytest.fixture
def store(store):
    store.add(mission_record("m"))
    return store


@pytest.fixture
def log(store):
    return EventLog(store, "m")


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
    for events in (log.live(0), log.catch_up(0)):
        assert [e["number"] for e in events if e["kind"] == "state"] == list(range(0, 1000, 100))
        telemetry = [e["number"] for e in events if e["kind"] == "telemetry"]
        assert telemetry == list(range(1000 - LIVE_TELEMETRY, 1000))
        assert [e["sequence"] for e in events] == sorted(e["sequence"] for e in events)


def test_memory_does_not_grow_and_what_left_it_is_read_from_the_database(log, monkeypatch):
    monkeypatch.setattr(event_log, "STORED_PAGE", 100)
    total = OTHERS_KEPT + 50
    for number in range(total):
        log.append({"kind": "state", "number": number})
        log.append({"kind": "telemetry", "number": number})
    assert len(log._others) == OTHERS_KEPT
    assert len(log._telemetry) == LIVE_TELEMETRY
    assert log.live(0) is None
    cursor, seen = 0, []
    while (events := log.live(cursor)) != []:
        events = log.catch_up(cursor) if events is None else events
        seen += [e["number"] for e in events if e["kind"] == "state"]
        cursor = events[-1]["sequence"]
    assert seen == list(range(total))


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
    newest, more = log.history(kinds=["plan"], limit=3, newest=True)
    assert ([e["number"] for e in newest], more) == ([19, 21, 23], True)
    with pytest.raises(Invalid, match="limit"):
        log.history(limit=0)


def test_a_log_goes_on_where_it_ended(log, store):
    log.append({"kind": "state"})
    log.append({"kind": "plan"})
    again = EventLog(store, "m")
    assert again.last_sequence == 2
    assert again.newest("plan")["sequence"] == 2
    again.append({"kind": "notice"})
    page, _ = again.history()
    assert [e["kind"] for e in page] == ["state", "plan", "notice"]


def test_a_database_that_cannot_be_written_holds_nothing_up_and_loses_nothing(log, store, monkeypatch):
    """A full disk: events are told as they come, and saved once it has room again, states with them."""

    def full(*_):
        raise StorageError("database or disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(store, "save", full)
        log.append({"kind": "state"}, mission_record("m").model_copy(update={"state": MissionState.RUNNING}))
        log.append({"kind": "plan"})
        assert [e["kind"] for e in log.live(0)] == ["state", "plan"]
    assert store.events("m", limit=10) == []
    log.append({"kind": "notice"})
    assert [e["sequence"] for e in store.events("m", limit=10)] == [1, 2, 3]
    assert store.find("m").state is MissionState.RUNNING


def test_while_nothing_can_be_saved_telemetry_gives_way_to_states(log, store, monkeypatch):
    def full(*_):
        raise StorageError("database or disk is full")

    with monkeypatch.context() as patched:
        patched.setattr(store, "save", full)
        patched.setattr(event_log, "BACKLOG", 50)
        for number in range(500):
            log.append({"kind": "state" if number % 25 == 0 else "telemetry", "number": number})
        assert len(log._unsaved) <= 51
    log.append({"kind": "notice"})
    states = store.events("m", limit=1000, kinds=["state"])
    assert [e["number"] for e in states] == list(range(0, 500, 25))


def test_readers_are_woken_until_they_leave(log):
    woken = []
    wake = lambda: woken.append(1)  # noqa: E731
    log.add_waker(wake)
    log.append({"kind": "state"})
    log.remove_waker(wake)
    log.append({"kind": "state"})
    assert woken == [1]


def test_the_database_is_asked_once_for_what_an_earlier_service_told(log, store, monkeypatch):
    log.append({"kind": "state"})
    again = EventLog(store, "m")
    assert not again.knows("state")
    assert again.newest("state")["sequence"] == 1
    assert again.newest("approval") is None
    monkeypatch.setattr(store, "events", lambda *_, **__: pytest.fail("asked again"))
    assert again.knows("state")
    assert again.knows("approval")
    assert again.newest("approval") is None
    again.append({"kind": "approval"})
    assert again.newest("approval")["sequence"] == 2


def test_a_log_that_begins_empty_knows_everything(log, store, monkeypatch):
    monkeypatch.setattr(store, "events", lambda *_, **__: pytest.fail("asked"))
    assert log.knows("plan")
    assert log.newest("plan") is None


def test_what_is_saved_shows_before_readers_are_woken(log):
    order = []
    log.add_waker(lambda: order.append("woken"))
    log.append({"kind": "state"}, saved=lambda: order.append("shown"))
    assert order == ["shown", "woken"]
