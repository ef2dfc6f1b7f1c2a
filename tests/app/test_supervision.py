"""What happens to a mission process when the service is gone, and the laws of the mission's states."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from app.missions.states import COMMANDS, TRANSITIONS, MissionState, commands_allowed
from tests.app.conftest import wait_until
from tests.app.fake_mission import runner

ENDED = {MissionState.COMPLETED, MissionState.FAILED, MissionState.ABORTED}

SERVICE = """
import sys, time
from pathlib import Path
from app.missions.service import MissionOrder, MissionService
from app.settings import Settings, SupervisionSettings

if __name__ == "__main__":
    folder, runner, orphan_s = sys.argv[1:]
    limits = SupervisionSettings(orphan_s=float(orphan_s))
    service = MissionService(
        Settings(data_dir=Path(folder), viewer=False, mission_threads=1, supervision=limits), runner=runner
    )
    order = MissionOrder(scene="house", scene_source="house", preset="quick", seed=0, max_time_s=None)
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


def test_a_mission_that_lost_its_service_saves_its_results_and_ends(tmp_path, repository):
    mission, results = _kill_service_around(tmp_path, repository, "run_long", orphan_s=60.0)
    wait_until(lambda: not mission.is_running())
    with open(f"{results}/report.json") as report:
        assert "interrupted" in report.read()


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
    assert commands_allowed(MissionState.RUNNING) == ["pause", "stop"]
    assert commands_allowed(MissionState.PAUSED) == ["resume", "stop"]
    assert commands_allowed(MissionState.STOPPING) == []
