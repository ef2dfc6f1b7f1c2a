"""The real mission through the service: started, watched over the WebSocket, stopped, and its report read."""

import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings
from tests.app.conftest import begin, wait_for

WS = "ws://127.0.0.1"
FRAMES = 5

REPORT_KEYS = {
    "schema_version",
    "scene",
    "seed",
    "stop_reason",
    "wall_s",
    "sim_time_s",
    "path_length_m",
    "frames",
    "keyframes",
    "n_gaussians",
    "peak_rss_mib",
    "collisions",
    "versions",
    "unseen",
}
"""What a report holds even when the mission was stopped before it could be evaluated."""


@pytest.mark.timeout(300)
def test_a_real_mission_is_started_watched_stopped_and_reported(tmp_path):
    settings = Settings(data_dir=tmp_path, viewer=False, mission_threads=2)
    app = create_app(settings)
    with TestClient(app, base_url="http://127.0.0.1") as client:
        mission = begin(client, scene="house", preset="quick", seed=0)
        path = f"/api/v1/missions/{mission}"
        with client.websocket_connect(f"{WS}{path}/events") as events:
            frames = []
            while len(frames) < FRAMES:
                event = events.receive_json()
                assert event.get("state") not in ("failed", "aborted"), event
                if event["kind"] == "telemetry":
                    frames.append(event)
            assert [e["frame"] for e in frames] == sorted(e["frame"] for e in frames)
            assert frames[-1]["n_gaussians"] > 1000
            assert frames[-1]["observed_volume_m3"] > frames[0]["observed_volume_m3"] * 0.99
            assert frames[-1]["collisions"] == 0
            assert client.post(f"{path}/stop").status_code == 202
            halted = None
            while event.get("kind") != "ended":
                event = events.receive_json()
                halted = event if event["kind"] == "halted" else halted
            # The robot stood before the loop had come to its end.
            assert halted is not None
            assert halted["sequence"] < event["sequence"]
            assert halted["at_s"] <= event["received_at"]
            assert event["stop_reason"] == "interrupted"
        wait_for(client, mission, "aborted")
        for kind in ("observed", "rendered", "depth", "quality"):
            assert client.get(f"{path}/images/{kind}").status_code == 200
        names = {entry["name"] for entry in client.get(f"{path}/results").json()}
        assert {"report.json", "config.yaml", "events.jsonl", "trajectory.txt", "map.ply"} <= names
        report = client.get(f"{path}/results/report.json").json()
        assert set(report) >= REPORT_KEYS
        assert report["stop_reason"] == "interrupted"
        assert report["seed"] == 0
        assert report["collisions"] == 0
        assert report["frames"] >= FRAMES
        splats = client.get(f"{path}/results/map.ply")
        assert splats.content.startswith(b"ply")
