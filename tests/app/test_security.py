import pytest
from starlette.websockets import WebSocketDisconnect

from app.settings import require_loopback, settings_from_environment
from hgs_core.errors import ConfigError
from tests.app.conftest import create

WS = "ws://127.0.0.1"


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "example.org", ""])
def test_addresses_that_others_reach_are_refused(host, tmp_path):
    with pytest.raises(ConfigError, match=r"no access control yet.*127\.0\.0\.1"):
        settings_from_environment(host=host, port=8000, data_dir=tmp_path, demo=False)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_this_machine_is_accepted(host):
    require_loopback(host)


def test_a_scenes_folder_that_is_missing_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("HGS_SCENES_DIR", str(tmp_path / "nowhere"))
    with pytest.raises(ConfigError, match="HGS_SCENES_DIR"):
        settings_from_environment(host="127.0.0.1", port=8000, data_dir=tmp_path, demo=False)


def test_a_foreign_host_name_is_refused(service):
    """Another site's name may point at 127.0.0.1 (DNS rebinding)."""
    client = service()
    answer = client.get("/api/v1/missions", headers={"Host": "evil.example"})
    assert answer.status_code == 403
    assert answer.headers["content-type"] == "application/problem+json"
    assert client.get("/api/v1/missions", headers={"Host": "localhost:8000"}).status_code == 200


def test_another_page_can_neither_command_nor_listen(service):
    client = service()
    mission = create(client)
    foreign = {"Origin": "https://evil.example"}
    for path in ("/api/v1/missions", f"/api/v1/missions/{mission}/stop"):
        assert client.post(path, json={"preset": "quick"}, headers=foreign).status_code == 403
    assert client.get(f"/api/v1/missions/{mission}").json()["state"] == "created"
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(f"{WS}/api/v1/missions/{mission}/events", headers=foreign),
    ):
        pass
    own = {"Origin": "http://127.0.0.1"}
    assert client.post(f"/api/v1/missions/{mission}/stop", headers=own).status_code == 202
