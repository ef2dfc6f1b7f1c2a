"""Many who watch, one of them stalled, and many questions: a mission and its operators notice nothing.

The long forms print their figures; what they must be is in `docs/service.md`.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import httpx
import numpy as np
import psutil
import pytest

from tests.app.fake_mission import runner
from tests.app.load_figures import say, until_ended
from tests.app.served import Served, served

REPOSITORY = Path(__file__).resolve().parents[2]
STATES = ["starting", "running", "stopping"]
READERS = 50
REQUESTS_PER_S = 20


def new_mission(client: httpx.Client, **wish) -> str:
    return client.post("/missions", json={"scene": "house", **wish}).raise_for_status().json()["id"]


def begin_load(service: Served, mission: str, readers: int) -> subprocess.Popen:
    command = [sys.executable, "-m", "tests.app.load_client", service.url, mission, str(readers)]
    return subprocess.Popen([*command, str(REQUESTS_PER_S)], stdout=subprocess.PIPE, cwd=REPOSITORY)


def planning_s(client: httpx.Client, mission: str) -> list[float]:
    """T_P of every plan, in order [s]."""
    found = client.get(f"/missions/{mission}/events", params={"kind": "plan", "limit": 1000}).json()["events"]
    return [event["planning_s"] for event in found]


def test_a_dozen_readers_and_steady_questions_lose_no_state(tmp_path):
    with (
        served(tmp_path / "data", runner=runner("run_short"), viewer=False, mission_threads=1) as service,
        httpx.Client(base_url=service.api, timeout=120) as client,
    ):
        mission = new_mission(client, preset="quick")
        load = begin_load(service, mission, 12)
        until_subscribed(service, 12)
        client.post(f"/missions/{mission}/start").raise_for_status()
        seen = json.loads(load.communicate(timeout=200)[0])
    assert seen["states"] == [[*STATES, "completed"]] * 11
    assert seen["refused"] == 0
    assert len(seen["request_s"]) > 5


def until_subscribed(service: Served, number: int) -> None:
    deadline = time.monotonic() + 120
    while True:
        lines = httpx.get(f"{service.url}metrics", timeout=60).text.splitlines()
        open_streams = [line for line in lines if line.startswith("hgs_stream_subscribers{")]
        if sum(float(line.split()[-1]) for line in open_streams) >= number:
            return
        assert time.monotonic() < deadline, open_streams
        time.sleep(0.2)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_fifty_readers_and_twenty_questions_a_second_cost_a_mission_little(tmp_path, capsys):
    """The same mission (same seed: the same plans) by turns with and without the load; T_P plan by plan.

    Clients elsewhere would take none of this machine's time; how much these take of it is told beside.
    """
    rounds = int(os.environ.get("HGS_LOAD_ROUNDS", "2"))
    times: dict[bool, list[list[float]]] = {False: [], True: []}
    latencies, memory, states = [], [], []
    service_s: dict[bool, list[float]] = {False: [], True: []}
    clients_s, wall_s = [], []
    with (
        served(tmp_path / "data") as service,
        httpx.Client(base_url=service.api, timeout=120) as client,
    ):
        process = psutil.Process(service.pid)
        for loaded in [False, True] * rounds:
            mission = new_mission(client, preset="quick", max_time_s=60, overrides={"evaluate": "false"})
            load = begin_load(service, mission, READERS) if loaded else None
            if loaded:
                until_subscribed(service, READERS)
            began, before = time.monotonic(), process.cpu_times()
            client.post(f"/missions/{mission}/start").raise_for_status()
            ended = until_ended(client, mission)
            assert ended["state"] == "completed", ended
            after = process.cpu_times()
            service_s[loaded].append(after.user + after.system - before.user - before.system)
            times[loaded].append(planning_s(client, mission))
            memory.append(process.memory_info().rss / 2**20)
            if load is not None:
                seen = json.loads(load.communicate(timeout=120)[0])
                assert seen["refused"] == 0
                clients_s.append(seen["processor_s"])
                wall_s.append(time.monotonic() - began)
                latencies += seen["request_s"]
                states += seen["states"]
    assert states == [[*STATES, "completed"]] * (rounds * (READERS - 1))
    n_plans = {len(of_one) for of_all in times.values() for of_one in of_all}
    assert len(n_plans) == 1, "the same seed plans the same"
    with_load, without = (np.median(times[loaded], axis=0) for loaded in (True, False))
    say(
        capsys,
        f"status request: median {1000 * np.median(latencies):.0f} ms, p99 "
        f"{1000 * np.quantile(latencies, 0.99):.0f} ms of {len(latencies)} with {READERS} readers and "
        f"{REQUESTS_PER_S} requests/s; T_P median {1000 * np.median(without):.0f} ms without and "
        f"{1000 * np.median(with_load):.0f} ms with the load, median ratio of {len(without)} plans "
        f"{np.median(with_load / without):.3f}; processor time a mission of {np.mean(wall_s):.0f} s: service "
        f"{np.mean(service_s[False]):.1f} s without and {np.mean(service_s[True]):.1f} s with the load, the "
        f"clients themselves {np.mean(clients_s):.1f} s; service's memory after each mission "
        f"{', '.join(f'{mib:.0f}' for mib in memory)} MiB; {len(states)} readers lost no state",
    )
