"""The bundle for a report of a fault holds what helps and nothing that is secret."""

import io
import json
import logging
import zipfile

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app.cli.application import application
from app.main import create_app
from app.settings import AccessSettings, Settings
from tests.app.conftest import begin, wait_for
from tests.app.fake_mission import runner

OPERATOR = "operator-secret-0123456789abcdef"
VIEWER = "viewer-secret-0123456789abcdef"
PARTS = {
    "about.json",
    "report.json",
    "trajectory.txt",
    "process.log",
    "service_events.jsonl",
    "last_view/observed.jpeg",
    "last_view/rendered.jpeg",
    "last_view/depth.png",
    "last_view/quality.png",
}


def opened(content: bytes) -> dict[str, bytes]:
    """Files of a ZIP by name, without the folder that all are in."""
    archive = zipfile.ZipFile(io.BytesIO(content))
    assert archive.testzip() is None
    assert len({name.split("/")[0] for name in archive.namelist()}) == 1
    return {name.partition("/")[2]: archive.read(name) for name in archive.namelist()}


@pytest.fixture
def bundled(tmp_path, monkeypatch, caplog):
    """A mission that has ended, its bundle from the service, and that from the shell."""
    caplog.set_level(logging.INFO)
    access = AccessSettings(operator_token=OPERATOR, viewer_token=VIEWER)
    settings = Settings(data_dir=tmp_path / "data", viewer=False, mission_threads=1, access=access)
    app = create_app(settings, runner=runner("run_short"))
    with TestClient(app, base_url="http://127.0.0.1") as client:
        client.headers["Authorization"] = f"Bearer {OPERATOR}"
        client.headers["Idempotency-Key"] = "a-name-of-the-client"
        mission = begin(client)
        wait_for(client, mission, "completed")
        answer = client.get(f"/api/v1/missions/{mission}/bundle")
        assert answer.status_code == 200
        refused = client.get(
            f"/api/v1/missions/{mission}/bundle", headers={"Authorization": f"Bearer {VIEWER}"}
        )
        assert refused.status_code == 403
        assert client.get("/api/v1/missions/nothing/bundle").status_code == 404
        # The service still runs: reading beside it disturbs nothing.
        monkeypatch.setenv("HGS_OPERATOR_TOKEN", OPERATOR)
        told = CliRunner().invoke(
            application,
            ["bundle", mission, "--data-dir", str(tmp_path / "data"), "--out", str(tmp_path / "b.zip")],
        )
        assert told.exit_code == 0, told.output
    return mission, opened(answer.content), opened((tmp_path / "b.zip").read_bytes())


def test_both_hold_what_helps_and_nothing_secret(bundled):
    mission, from_service, from_shell = bundled
    assert set(from_service) == PARTS | {"service.log"}
    assert set(from_shell) == PARTS
    about = json.loads(from_service["about.json"])
    assert about["mission"]["id"] == mission
    assert about["versions"]["hgs"]
    assert about["machine"]["processors"] >= 1
    assert about["machine"]["disk_free_bytes"] > 0
    assert about["settings"]["missions_at_once"] == 1
    events = [json.loads(line) for line in from_service["service_events.jsonl"].splitlines()]
    assert [e["state"] for e in events if e["kind"] == "state"][-1] == "completed"
    assert mission in from_service["service.log"].decode()
    for content in (*from_service.values(), *from_shell.values()):
        for secret in (OPERATOR, VIEWER, "a-name-of-the-client"):
            assert secret.encode() not in content


def test_a_run_without_a_service_and_a_mission_without_a_database_have_theirs(bundled, tmp_path):
    mission, _, _ = bundled
    folder = tmp_path / "data" / "missions" / mission / "run"
    told = CliRunner().invoke(application, ["bundle", str(folder), "--out", str(tmp_path / "c.zip")])
    assert told.exit_code == 0, told.output
    assert set(opened((tmp_path / "c.zip").read_bytes())) == {"about.json", "report.json", "trajectory.txt"}
    for path in (tmp_path / "data").glob("hgs.db*"):
        path.unlink()
    arguments = ["bundle", mission, "--data-dir", str(tmp_path / "data"), "--out", str(tmp_path / "d.zip")]
    assert CliRunner().invoke(application, arguments).exit_code == 0
    about = json.loads(opened((tmp_path / "d.zip").read_bytes())["about.json"])
    assert about["mission"] is None
    assert "there is no database" in about["remarks"][0]


def test_what_is_none_is_said_to_be_none(tmp_path):
    (tmp_path / "empty").mkdir()
    for name in ("no-such-mission", str(tmp_path / "empty"), "../data"):
        told = CliRunner().invoke(application, ["bundle", name, "--data-dir", str(tmp_path)])
        assert told.exit_code == 2, told.output
