"""Logs: one event a line, with what it belongs to, and nothing that is secret."""

import io
import json
import logging

import pytest
from fastapi.testclient import TestClient

from app.logs import LogLevel, LogStyle, RecentLogs, configure_logging
from app.main import create_app
from app.settings import AccessSettings, LogSettings, Settings, settings_from_environment
from app.storage.database import Database
from hgs_core.errors import ConfigError
from tests.app.conftest import begin, wait_for
from tests.app.fake_mission import runner

OPERATOR = "operator-secret-0123456789abcdef"
VIEWER = "viewer-secret-0123456789abcdef"
GUESS = "guessed-secret-0123456789abcdef"


@pytest.fixture
def written():
    """`written(style, level)` sends all logs to the text stream that it returns."""
    root = logging.getLogger()
    before, level = list(root.handlers), root.level
    logging.getLogger("httpx").setLevel(logging.WARNING)  # the tests' own client tells every URL

    def configure(style: LogStyle, level: LogLevel = LogLevel.DEBUG) -> io.StringIO:
        stream = io.StringIO()
        configure_logging(style, level, stream=stream, process="service")
        return stream

    yield configure
    root.handlers[:] = before
    root.setLevel(level)
    logging.getLogger("httpx").setLevel(logging.NOTSET)


@pytest.fixture
def client(tmp_path):
    def begin_with(runner_name: str = "run_short", **changes) -> TestClient:
        access = AccessSettings(operator_token=OPERATOR, viewer_token=VIEWER)
        settings = Settings(data_dir=tmp_path / "data", viewer=False, access=access, **changes)
        return TestClient(
            create_app(settings, runner=runner(runner_name)),
            base_url="http://127.0.0.1",
            raise_server_exceptions=False,
        )

    return begin_with


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def lines(stream: io.StringIO) -> list[dict]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_every_line_is_json_and_says_when_where_and_how_grave(written):
    stream = written(LogStyle.JSON)
    logging.getLogger("some.module").warning("%d of %s", 3, "many", extra={"mission": "m-1", "size": 2.5})
    logging.getLogger("some.module").error("with a\nbreak and ümläut")
    try:
        raise ValueError("what happened")
    except ValueError:
        logging.getLogger("other").exception("it failed")
    first, second, third = lines(stream)
    assert first.pop("timestamp").endswith("Z")
    assert first == {
        "event": "3 of many",
        "level": "warning",
        "logger": "some.module",
        "mission": "m-1",
        "process": "service",
        "size": 2.5,
    }
    assert second["event"] == "with a\nbreak and ümläut"
    assert "ValueError: what happened" in third["exception"]


def test_levels_are_kept_to_and_configuring_again_changes_the_place(written):
    first = written(LogStyle.CONSOLE, LogLevel.WARNING)
    logging.getLogger("m").info("not this")
    logging.getLogger("m").warning("but this")
    second = written(LogStyle.JSON, LogLevel.INFO)
    logging.getLogger("m").info("and this")
    assert "not this" not in first.getvalue()
    assert "but this" in first.getvalue()
    assert "and this" not in first.getvalue()
    assert lines(second)[0]["event"] == "and this"


def test_a_request_has_an_id_that_its_lines_and_its_answer_carry(client, written):
    stream = written(LogStyle.JSON, LogLevel.INFO)
    with client() as service:
        ids = []
        for given in ({}, {"X-Request-ID": "from-the-page.7"}, {"X-Request-ID": 'no"good\x7f'}):
            answer = service.post(
                "/api/v1/missions", json={"preset": "quick"}, headers={**bearer(OPERATOR), **given}
            )
            ids.append(answer.headers["x-request-id"])
        assert ids[1] == "from-the-page.7"
        assert len(set(ids)) == 3
        assert all(len(found) == 16 for found in (ids[0], ids[2]))
        refused = service.get("/api/v1/audit", headers=bearer(VIEWER))
        assert refused.headers["x-request-id"]
    told = [line for line in lines(stream) if line["logger"] == "app.requests"]
    assert [line["request"] for line in told] == ids  # looking is told at level debug alone
    assert {line["route"] for line in told} == {"/api/v1/missions"}
    assert {(line["status"], line["actor"]) for line in told} == {(201, "operator")}


def test_lines_about_a_mission_name_it_in_both_processes(client, written):
    stream = written(LogStyle.JSON, LogLevel.INFO)
    with client(logs=LogSettings(style=LogStyle.JSON)) as service:
        service.headers.update(bearer(OPERATOR))
        mission = begin(service)
        wait_for(service, mission, "completed")
        log_file = service.app.state.service.get(mission).log_file
        own = [json.loads(line) for line in log_file.read_text().splitlines()]
    states = [line["state"] for line in lines(stream) if line.get("mission") == mission and "state" in line]
    assert states == ["starting", "running", "stopping", "completed"]
    assert own
    assert {(line["mission"], line["process"]) for line in own} == {(mission, "mission")}
    assert "mission event: ended" in [line["event"] for line in own]


@pytest.mark.parametrize("style", list(LogStyle))
def test_nothing_secret_is_written(client, written, style, monkeypatch):
    stream = written(style)
    recent = RecentLogs()

    def fail(*_, **__):
        token = OPERATOR  # a local variable that a rich traceback would show
        raise RuntimeError(f"failed with a token of {len(token)} characters")

    with recent.listening(), client("run_failing", logs=LogSettings(style=style)) as service:
        for token in (OPERATOR, VIEWER, GUESS):
            service.post("/api/v1/missions", json={"preset": "quick"}, headers=bearer(token))
            service.post("/api/v1/session", json={"token": token}, headers={"Origin": "http://127.0.0.1"})
            service.get("/api/v1/missions", params={"cursor": token}, headers=bearer(OPERATOR))
            service.get(f"/api/v1/missions?token={token}", headers=bearer(OPERATOR))
        cookies = list(service.cookies.values())
        service.cookies.clear()
        service.headers.update(bearer(OPERATOR))
        mission = begin(service)
        while service.get(f"/api/v1/missions/{mission}").json()["state"] != "failed":
            pass
        output = service.app.state.service.get(mission).log_file.read_text()
        monkeypatch.setattr(service.app.state.service, "page", fail)
        assert service.get("/api/v1/missions").status_code == 500
    everything = stream.getvalue() + output + "\n".join(recent.lines())
    assert "failed with a token of 32 characters" in everything
    assert "SceneError" in output
    assert cookies
    for secret in (OPERATOR, VIEWER, GUESS, *cookies):
        assert secret not in everything


def test_the_password_of_the_database_is_written_nowhere(written):
    stream = written(LogStyle.JSON)
    with pytest.raises(ConfigError) as refusal:
        Database("postgresql://hgs:the-password@127.0.0.1:1/none").open()
    logging.getLogger("m").error("%s", refusal.value)
    assert "the-password" not in stream.getvalue() + str(refusal.value)


def test_recent_lines_are_few():
    recent = RecentLogs()
    with recent.listening():
        for number in range(5_000):
            logging.getLogger("m").warning("line %d", number)
    logging.getLogger("m").warning("not heard any more")
    assert len(recent.lines()) == 2_000
    assert json.loads(recent.lines()[-1])["event"] == "line 4999"


def test_the_environment_says_how_to_log_and_what_to_keep(tmp_path):
    def told(**environment):
        return settings_from_environment(
            host="127.0.0.1", port=1, data_dir=tmp_path, demo=False, environment=environment
        )

    settings = told(
        HGS_LOG_STYLE="json",
        HGS_LOG_LEVEL="warning",
        HGS_MAX_SIZE="200GB",
        HGS_ROOM="2GiB",
        HGS_MAX_AGE_DAYS="1.5",
        HGS_KEEP_MISSIONS="20",
        HGS_OPEN_METRICS="yes",
    )
    assert settings.logs == LogSettings(style=LogStyle.JSON, level=LogLevel.WARNING)
    assert settings.retention.max_bytes == 200 * 10**9
    assert settings.retention.room_bytes == 2 * 2**30
    assert settings.retention.max_age_s == 1.5 * 86_400
    assert settings.retention.keep_missions == 20
    assert settings.access.open_metrics
    for name, value in (
        ("HGS_LOG_STYLE", "xml"),
        ("HGS_LOG_LEVEL", "loud"),
        ("HGS_MAX_SIZE", "much"),
        ("HGS_MAX_SIZE", "0"),
        ("HGS_MAX_AGE_DAYS", "-1"),
        ("HGS_MAX_AGE_DAYS", "nan"),
        ("HGS_KEEP_MISSIONS", "2.5"),
        ("HGS_OPEN_METRICS", "perhaps"),
    ):
        with pytest.raises(ConfigError, match=name):
            told(**{name: value})
