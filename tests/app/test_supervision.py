"""What happens to a mission process when the service is gone, and the laws of the mission's states."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from app.missions.service import MissionService
from app.missions.states import COMMANDS, TRANSITIONS, MissionState, commands_allowed
from app.settings import Settings
from app.storage.database import Database
from app.storage.missions import MissionStore
from tests.app.conftest import wait_until
from tests.app.fake_mission import runner

ENDED = {MissionState.COMPLETED, MissionState.FAILED, MissionState.ABORTED}

SERVICE = """
import sys, time
from pathlib import Path
from app.missions.service import MissionOrder, MissionService
from app.settings import Settings, SupervisionSettings
from app.storage.database import Database
from app.storage.missions import MissionStore

if __name__ == "__main__":
    folder, runner, orphan_s = sys.argv[1:]
    limits = SupervisionSettings(orphan_s=float(orphan_s))
    settings = Settings(data_dir=Path(folder), viewer=False, mission_threads=1, supervision=limits)
    settings.data_dir.mkdir()
    database = Database(settings.database)
    database.open()
    service = MissionService(settings, MissionStore(database), runner=runner)
    order = MissionOrder(
        scene="house", scene_source="house", preset="quick", preset_source="quick", seed=0, max_time_s=None
    )
    mission, _ = service.create(order)
    service.start(mission.id)
    while mission.state != "running":
        time.sleep(0.02)
    print(mission.pid, mission.results_dir, flush=True)
    time.sleep(1000)
"""


def _kill_service_around(tmp_path, repository, runner_name: str, orphan_s: float):
    """Run a service with a mission in a process, kill it, and return the mission's process and folder."""
    script = tmp_path / "service.py"
    script.write_text(SERVICE)
    service = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / "data"), runner(runner_name), str(orphan_s)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=repository,
        env={**os.environ, "PYTHONPATH": str(repository)},
    )
    assert service.stdout is not None
    pid, results = service.stdout.readline().split()
    mission = psutil.Process(int(pid))
    assert mission.is_running()
    service.send_signal(signal.SIGKILL)
    service.wait()
    return mission, results


def test_a_mission_that_lost_its_service_saves_where_it_is_and_ends(tmp_path, repository):
    mission, results = _kill_service_around(tmp_path, repository, "run_long", orphan_s=60.0)
    wait_until(lambda: not mission.is_running())
    assert not Path(results).exists()
    assert int(Path(f"{results}.partial/saved.json").read_text()) >= 0


def test_the_next_service_says_what_became_of_a_mission_that_lost_its_service(tmp_path, repository):
    mission, results = _kill_service_around(tmp_path, repository, "run_long", orphan_s=60.0)
    wait_until(lambda: not mission.is_running())
    settings = Settings(data_dir=tmp_path / "data", viewer=False)
    database = Database(settings.database)
    database.open()
    again = MissionService(settings, MissionStore(database))
    again.begin()
    (found,) = again.page(10)
    assert str(found.results_dir) == results
    assert (found.state, found.record.stop_reason) == (MissionState.INTERRUPTED, "interrupted")
    assert found.record.reason == "the service ended while the mission was running"
    events, _ = found.log.history(limit=5000)
    assert [e["sequence"] for e in events] == list(range(1, len(events) + 1))
    assert [e["state"] for e in events if e["kind"] == "state"] == ["starting", "running", "interrupted"]
    database.close()


def test_a_mission_that_does_not_listen_ends_with_its_service_all_the_same(tmp_path, repository):
    mission, _ = _kill_service_around(tmp_path, repository, "run_deaf", orphan_s=0.5)
    began = time.monotonic()
    wait_until(lambda: not mission.is_running())
    assert time.monotonic() - began < 60


@pytest.mark.parametrize("state", MissionState)
def test_states_lead_to_an_end_and_ends_lead_nowhere(state):
    assert state.ended == (state in ENDED)
    assert not (state.ended and state.active)
    if not state.ended:
        assert TRANSITIONS[state] & ENDED
        assert state in COMMANDS["stop"]
    else:
        assert commands_allowed(state) == []


def test_toolbars_offer_what_can_be_done():
    assert commands_allowed(MissionState.CREATED) == ["start", "stop"]
    assert commands_allowed(MissionState.QUEUED) == ["stop"]
    assert commands_allowed(MissionState.RUNNING) == ["pause", "stop"]
    assert commands_allowed(MissionState.PAUSED) == ["resume", "stop"]
    assert commands_allowed(MissionState.STOPPING) == []
    assert commands_allowed(MissionState.INTERRUPTED) == ["resume", "stop"]
