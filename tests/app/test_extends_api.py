"""Missions over the interface that begin with the maps of a finished one."""

from pathlib import Path

from hgs_core.mission.config import resolve_mission_config
from hgs_core.mission.finished_run import write_run_config
from hgs_core.mission.old_map import EXPLORATION
from hgs_core.mission.request import MissionRequest
from hgs_core.scene.free_floor import StartPose
from tests.app.conftest import begin, wait_for


def describe(folder: Path, scene: str = "house") -> None:
    """Let the fake mission's folder look as if a real one had left it."""
    request = MissionRequest(scene=scene, preset="quick", seed=0, out=folder, max_time_s=None, overrides={})
    config = resolve_mission_config("quick", {})
    write_run_config(folder, request, config, StartPose(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    (folder / EXPLORATION).write_bytes(b"")


def test_a_mission_extends_a_finished_one_in_the_same_scene(service):
    client = service("run_short")
    first = begin(client)
    wait_for(client, first, "completed")
    folder = client.app.state.service.get(first).results_dir
    describe(folder)
    created = client.post("/api/v1/missions", json={"preset": "quick", "extends": first})
    assert created.status_code == 201, created.text
    second = created.json()["id"]
    assert created.json()["extends"] == first
    client.post(f"/api/v1/missions/{second}/start")
    wait_for(client, second, "completed")
    report = client.get(f"/api/v1/missions/{second}/results/report.json").json()
    assert report["extends"] == str(folder)

    for wish, says in (
        ({"extends": "nothing"}, "there is no mission"),
        ({"extends": first, "scene": "house:3"}, "of the scene house, not house:3"),
        ({"extends": first, "overrides": {"sensor": "rgbd_5m_tiny"}}, "sensor.camera.width is"),
        ({"extends": second}, "config.yaml is missing"),
        ({"extends": "../etc"}, "pattern"),
    ):
        refused = client.post("/api/v1/missions", json={"preset": "quick", **wish})
        assert refused.status_code == 422
        assert refused.json()["errors"][0]["field"] == "extends"
        assert says in refused.json()["errors"][0]["message"]
