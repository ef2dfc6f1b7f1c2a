"""Whose files go, whose stay, and what is refused when there is no room."""

import contextlib
import time

import pytest

from app.errors import NoRoom
from app.missions.retention import Retention
from app.missions.service import MissionService
from app.missions.states import MissionState
from app.settings import RetentionSettings, Settings
from app.storage.audit import AuditStore
from app.storage.space import LIGHT, Space
from app.storage.tables import FilesKept
from tests.app.conftest import begin, create, wait_for, wait_until
from tests.app.databases import mission_record

KIB = 1024
LARGE = 64 * KIB
SMALL = 4 * KIB


@pytest.fixture
def missions_dir(tmp_path):
    return tmp_path / "data" / "missions"


@pytest.fixture
def retention(tmp_path, database, store, missions_dir):
    """`retention(max_bytes=...)` over the missions in `store`; nothing is needed for a new one."""

    def made(**settings) -> Retention:
        service = MissionService(Settings(data_dir=tmp_path / "data"), store)
        given = RetentionSettings(**{"room_bytes": 0, **settings})
        return Retention(given, service, store, AuditStore(database), Space(missions_dir))

    return made


@pytest.fixture
def mission(store, missions_dir):
    """`mission("a", ended_at=...)`: one that has ended, 64 KiB of map and 4 KiB of report."""

    def made(mission_id: str, *, ended_at: float | None, **changes) -> None:
        state = MissionState.CREATED if ended_at is None else MissionState.COMPLETED
        store.add(mission_record(mission_id, state=state, ended_at=ended_at, **changes))
        run = missions_dir / mission_id / "run"
        (run / "keyframes").mkdir(parents=True)
        (run / "keyframes" / "0.jpg").write_bytes(bytes(LARGE // 2))
        (run / "keyframes" / "report.json").write_bytes(b"not the report")
        (run / "map.ply").write_bytes(bytes(LARGE // 2))
        (run / "report.json").write_bytes(bytes(SMALL))

    return made


def files(missions_dir, mission_id: str) -> set[str]:
    root = missions_dir / mission_id
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}


WHOLE = {"run/keyframes/0.jpg", "run/keyframes/report.json", "run/map.ply", "run/report.json"}


def test_without_limits_everything_stays(retention, mission, missions_dir):
    mission("a", ended_at=1.0)
    retention().sweep()
    assert files(missions_dir, "a") == WHOLE


def test_the_oldest_give_up_their_large_files_until_the_rest_fits(retention, mission, missions_dir, store):
    for number, name in enumerate("cab"):  # ended in this order
        mission(name, ended_at=float(number + 1))
    retention(max_bytes=3 * (LARGE + 4 * SMALL) - LARGE).sweep()
    assert files(missions_dir, "c") == {"run/report.json"}
    assert files(missions_dir, "a") == files(missions_dir, "b") == WHOLE
    assert [store.find(name).files for name in "cab"] == [FilesKept.LIGHT, FilesKept.ALL, FilesKept.ALL]


def test_reports_go_only_when_large_files_are_not_enough(retention, mission, missions_dir, store):
    for number, name in enumerate("abc"):
        mission(name, ended_at=float(number + 1))
    retention(max_bytes=2 * SMALL).sweep()
    assert files(missions_dir, "a") == set()
    assert not (missions_dir / "a").exists()
    assert files(missions_dir, "b") == files(missions_dir, "c") == {"run/report.json"}
    assert store.find("a").files is FilesKept.NONE
    told = [event["message"] for event in store.events("a", limit=10)]
    assert told == [
        "its large files are removed: to make room for others",
        "its files are removed: to make room for others",
    ]


def test_pinned_missions_and_those_that_have_not_ended_are_never_touched(
    retention, mission, missions_dir, store
):
    mission("pinned", ended_at=1.0, pinned=True)
    mission("waiting", ended_at=None)
    mission("other", ended_at=2.0)
    for settings in ({"max_bytes": 1}, {"max_age_s": 1.0}, {"keep_missions": 1}):
        with pytest.raises(NoRoom) if "max_bytes" in settings else contextlib.nullcontext():
            retention(**settings).make_room()
    assert files(missions_dir, "pinned") == files(missions_dir, "waiting") == WHOLE
    assert files(missions_dir, "other") == set()


def test_old_ones_and_all_but_the_newest_go_although_there_is_room(retention, mission, missions_dir):
    now = time.time()
    for name, age_s in (("old", 100.0), ("young", 10.0), ("younger", 5.0)):
        mission(name, ended_at=now - age_s)
    mission("pinned", ended_at=now - 1000.0, pinned=True)
    retention(max_age_s=50.0).sweep()
    assert files(missions_dir, "old") == {"run/report.json"}
    assert files(missions_dir, "young") == WHOLE
    retention(keep_missions=1).sweep()
    assert files(missions_dir, "young") == {"run/report.json"}
    assert files(missions_dir, "younger") == files(missions_dir, "pinned") == WHOLE


def test_every_removal_is_in_the_audit_and_told_once(retention, mission, database, store):
    mission("a", ended_at=1.0)
    keeper = retention(max_age_s=1.0)
    keeper.sweep()
    keeper.sweep()
    (entry,) = AuditStore(database).page(10)
    assert (entry.actor, entry.method, entry.path) == ("retention", "DELETE", "/missions/a/files?keep=light")
    assert len(store.events("a", limit=10)) == 1


def test_a_removal_that_was_cut_short_is_finished_later(retention, mission, missions_dir, store):
    mission("a", ended_at=1.0, files=FilesKept.LIGHT)
    mission("b", ended_at=1.0, files=FilesKept.NONE)
    mission("c", ended_at=1.0)
    retention().finish_removals()
    assert files(missions_dir, "a") == {"run/report.json"}
    assert files(missions_dir, "b") == set()
    assert files(missions_dir, "c") == WHOLE


def test_a_refusal_says_what_is_missing(retention, mission):
    mission("pinned", ended_at=1.0, pinned=True)
    with pytest.raises(NoRoom, match=r"needs 1.0 MiB: .* of the 512.0 KiB they may; .* more must be free"):
        retention(max_bytes=512 * KIB, room_bytes=1024 * KIB).make_room()
    with pytest.raises(NoRoom, match="are free on the disk"):
        retention(room_bytes=2**60).make_room()


def test_light_files_are_light():
    assert {"report.json", "process.log"} <= LIGHT
    assert not LIGHT & {"map.ply", "mesh.ply", "last_view.npz", "transforms.json"}


def test_the_service_refuses_what_it_has_no_room_for_and_lets_pinned_missions_be(service):
    client = service("run_short", retention=RetentionSettings(max_bytes=1, room_bytes=0, interval_s=0.1))
    first = begin(client)  # there is nothing yet
    assert client.put(f"/api/v1/missions/{first}/pin").json()["pinned"] is True
    wait_for(client, first, "completed")
    refusal = client.post("/api/v1/missions", json={"preset": "quick"})
    assert (refusal.status_code, refusal.headers["content-type"]) == (507, "application/problem+json")
    assert refusal.json()["title"] == "No room"
    assert client.get(f"/api/v1/missions/{first}/results").json()
    assert client.delete(f"/api/v1/missions/{first}/pin").json()["pinned"] is False
    second = create(client)
    assert client.get(f"/api/v1/missions/{first}").json()["files"] == "none"
    assert client.get(f"/api/v1/missions/{first}/results").json() == []
    for kind in ("observed", "rendered"):
        assert client.get(f"/api/v1/missions/{first}/images/{kind}").status_code == 404
    assert client.post(f"/api/v1/missions/{second}/start").status_code == 202
    wait_for(client, second, "completed")
    wait_until(lambda: client.get(f"/api/v1/missions/{second}").json()["files"] == "none")
