"""What the service remembers, on SQLite and on a real PostgreSQL."""

import sqlite3
import threading

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from sqlalchemy import text
from sqlmodel import SQLModel

from app.errors import Conflict
from app.missions.states import MissionState
from app.storage.audit import AuditStore
from app.storage.data_dir import DataDirLock, write_whole
from app.storage.database import MIGRATIONS, Database, StorageError
from app.storage.logins import LoginStore
from app.storage.missions import MissionStore
from app.storage.presets import PresetStore
from app.storage.tables import AuditRecord, LoginRow, PresetRecord
from hgs_core.errors import ConfigError
from hgs_core.mission.clock import ClockKind
from tests.app.databases import fresh_database, mission_record


def test_the_migrations_lead_to_the_tables_as_the_code_knows_them(database):
    with database.engine.connect() as connection:
        differences = compare_metadata(MigrationContext.configure(connection), SQLModel.metadata)
    assert differences == []


def test_a_database_of_the_first_version_keeps_its_missions_and_their_events(database_url):
    database = Database(database_url)
    with database.engine.begin() as connection:
        config = Config()
        config.set_main_option("script_location", str(MIGRATIONS))
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        columns = {
            **dict.fromkeys(("scene", "scene_source", "preset", "preset_source", "created_by"), "'x'"),
            "id": "'m'",
            "state": "'completed'",
            "reason": "'seen'",
            "overrides": "'{}'",
            "seed": "0",
            "created_at": "1.5",
            "view_sequence": "0",
        }
        names, values = ", ".join(columns), ", ".join(columns.values())
        connection.execute(text(f"INSERT INTO mission ({names}) VALUES ({values})"))
        connection.execute(
            text("INSERT INTO event (mission_id, sequence, kind, content) VALUES ('m', 1, 'state', '{}')")
        )
    database.open()
    store = MissionStore(database)
    assert store.find("m").reason == "seen"
    assert store.last_sequence("m") == 1
    database.close()


def test_opening_again_changes_nothing(database_url):
    for _ in range(2):
        database = Database(database_url)
        database.open()
        database.check()
        database.close()


def test_a_record_comes_back_as_it_was(store):
    record = mission_record(
        "a",
        overrides={"limits.max_time_s": "3", "名": 'é\\u0000"'},
        clock=ClockKind.REAL,
        max_time_s=0.1 + 0.2,
        created_at=1763858096.1234567,
        idempotency_key="k",
        request_digest="0" * 64,
    )
    store.add(record)
    found = store.find("a")
    assert found == record
    assert found.clock is ClockKind.REAL
    assert found.state is MissionState.CREATED
    assert store.find_by_key("k") == record
    assert store.find("b") is None
    assert store.find_by_key("l") is None


def test_an_id_and_a_key_belong_to_one_mission(store):
    store.add(mission_record("a", idempotency_key="k"))
    for again in (mission_record("a"), mission_record("b", idempotency_key="k")):
        with pytest.raises(Conflict, match="exists already"):
            store.add(again)
    store.add(mission_record("c"))
    store.add(mission_record("d"))  # no key is no clash


def test_one_key_raced_by_many_makes_one_mission(store):
    outcomes = []

    def race(number: int) -> None:
        try:
            store.add(mission_record(f"m{number}", idempotency_key="k"))
            outcomes.append("made")
        except Conflict:
            outcomes.append("refused")

    threads = [threading.Thread(target=race, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(outcomes) == ["made"] + ["refused"] * 7


def test_a_state_and_its_event_are_saved_together_or_not_at_all(store, database):
    record = mission_record("a")
    store.add(record)
    event = {"sequence": 1, "kind": "state", "state": "running", "text": 'ü "quoted"', "n": [1, None, 2.5]}
    running = record.model_copy(update={"state": MissionState.RUNNING})
    store.save([event], running, "a")
    assert store.events("a", limit=9) == [event]
    # The second event has a number that is taken: neither it nor the record it came with is saved.
    with pytest.raises(Exception, match=r"(?i)unique"):
        store.save([event], running.model_copy(update={"state": MissionState.PAUSED}), "a")
    assert store.find("a").state is MissionState.RUNNING
    assert store.events("a", limit=9) == [event]


def test_missions_come_a_page_at_a_time_newest_first_even_when_made_at_once(store):
    times = {"a": 10.0, "b": 11.5, "c": 11.5, "d": 11.5, "e": 12.25}
    for name, at in times.items():
        store.add(mission_record(name, created_at=at))
    seen, before = [], None
    while page := store.page(2, before=before):
        seen += [record.id for record in page]
        before = (page[-1].created_at, page[-1].id)
    assert seen == ["e", "d", "c", "b", "a"]
    store.save([], store.find("c").model_copy(update={"state": MissionState.QUEUED}), "c")
    store.save([], store.find("a").model_copy(update={"state": MissionState.FAILED}), "a")
    assert [r.id for r in store.page(9, states=[MissionState.QUEUED, MissionState.FAILED])] == ["c", "a"]
    assert [record.id for record in store.unfinished()] == ["b", "c", "d", "e"]


def test_presets_are_saved_replaced_and_deleted(database):
    presets = PresetStore(database)
    record = PresetRecord(
        name="mine", base="paper", description="", overrides={"a.b": "1"}, saved_by="me", saved_at=1.5
    )
    assert presets.save(record)
    assert not presets.save(record.model_copy(update={"base": "quick"}))
    assert presets.find("mine").base == "quick"
    assert [preset.name for preset in presets.all()] == ["mine"]
    assert presets.delete("mine")
    assert not presets.delete("mine")
    assert presets.find("mine") is None


def test_the_audit_is_read_newest_first_in_pages(database):
    audit = AuditStore(database)
    for number in range(5):
        audit.add(
            AuditRecord(
                at=float(number),
                actor="a",
                role="operator",
                address="::1",
                method="POST",
                path="/",
                status=201,
            )
        )
    first = audit.page(3)
    assert [entry.at for entry in first] == [4.0, 3.0, 2.0]
    assert [entry.at for entry in audit.page(3, before=first[-1].id)] == [1.0, 0.0]


def test_logins_that_expired_are_forgotten(database):
    logins = LoginStore(database)
    for name, expires_at in (("old", 10.0), ("new", 30.0)):
        logins.add(
            LoginRow(secret_digest=name, token_digest="t", opened_at=0, expires_at=expires_at), now=5.0
        )
    assert {row.secret_digest for row in logins.all()} == {"old", "new"}
    logins.add(LoginRow(secret_digest="third", token_digest="t", opened_at=0, expires_at=40.0), now=20.0)
    assert {row.secret_digest for row in logins.all()} == {"new", "third"}
    logins.delete("new")
    assert [row.secret_digest for row in logins.all()] == ["third"]


def test_a_database_of_a_newer_version_is_left_alone(database_url):
    database = Database(database_url)
    database.open()
    with database.engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    database.close()
    with pytest.raises(ConfigError, match="newer version"):
        Database(database_url).open()


def test_two_services_cannot_share_a_postgresql_database(postgres):
    url = fresh_database(postgres)
    first, second = Database(url), Database(url)
    first.open()
    with pytest.raises(ConfigError, match="in use"):
        second.open()
    first.close()
    second.open()
    second.close()


def test_two_services_cannot_share_a_data_folder(tmp_path):
    first = DataDirLock(tmp_path)
    with pytest.raises(ConfigError, match="HGS_DATA_DIR"):
        DataDirLock(tmp_path)
    first.release()
    DataDirLock(tmp_path).release()


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("nonsense", "not one"),
        ("mysql://localhost/hgs", "not supported"),
        ("postgresql://nobody@127.0.0.1:1/hgs", "cannot be used"),
        ("sqlite:////proc/nowhere/hgs.db", "cannot be used"),
    ],
)
def test_a_database_that_cannot_be_used_is_refused_in_words(url, says):
    with pytest.raises(ConfigError, match=says):
        Database(url).open()


def test_a_password_in_the_url_is_never_shown():
    with pytest.raises(ConfigError) as refusal:
        Database("postgresql://hgs:secret-word@127.0.0.1:1/hgs").open()
    assert "secret-word" not in str(refusal.value)


def test_sqlite_is_in_wal_mode_and_a_reader_does_not_wait_for_a_writer(tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'hgs.db'}")
    database.open()
    other = sqlite3.connect(tmp_path / "hgs.db", isolation_level=None)
    assert other.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    other.execute("BEGIN IMMEDIATE")
    PresetStore(database).all()
    other.execute("ROLLBACK")
    database.check()
    other.close()
    database.close()


def test_a_full_disk_is_an_error_of_the_storage(tmp_path):
    database = Database(f"sqlite:///{tmp_path / 'hgs.db'}")
    database.open()

    def fill() -> None:
        with database.transaction() as session:
            pages = session.connection().execute(text("PRAGMA page_count")).scalar()
            session.connection().execute(text(f"PRAGMA max_page_count={pages}"))
            preset = "INSERT INTO preset VALUES ('n', 'b', :filler, '{}', 'me', 0)"
            session.connection().execute(text(preset), {"filler": "x" * 100_000})

    with pytest.raises(StorageError, match="full"):
        fill()
    assert PresetStore(database).all() == []
    database.close()


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "folder" / "file"
    write_whole(path, lambda file: file.write(b"first"))

    def fail_half_way(file) -> None:
        file.write(b"sec")
        raise OSError("no space left on device")

    with pytest.raises(OSError, match="no space"):
        write_whole(path, fail_half_way)
    assert path.read_bytes() == b"first"
    assert [entry.name for entry in path.parent.iterdir()] == ["file"]
