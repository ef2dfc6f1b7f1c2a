"""Mission after mission through one service: what it holds does not grow with what it has done."""

import json
import os
import sys
import time
from dataclasses import dataclass

import httpx
import numpy as np
import psutil
import pytest

from tests.app.fake_mission import runner
from tests.app.served import Served, served


@dataclass(frozen=True, kw_only=True)
class Holding:
    """What the service's process holds after so many missions."""

    missions: int
    rss_mib: float
    files: int
    threads: int
    database_kib: float
    """With its write-ahead log."""


def holding(service: Served, data_dir, missions: int) -> Holding:
    process = psutil.Process(service.pid)
    return Holding(
        missions=missions,
        rss_mib=process.memory_info().rss / 2**20,
        files=process.num_fds(),
        threads=process.num_threads(),
        database_kib=sum(path.stat().st_size for path in data_dir.glob("hgs.db*")) / 1024,
    )


def run_missions(data_dir, number: int, *, look_every: int) -> list[Holding]:
    """Missions of a second each, one after another, each watched and asked about as by a page."""
    found = []
    with (
        served(data_dir, runner=runner("run_short"), viewer=False, mission_threads=1) as service,
        httpx.Client(base_url=service.api, timeout=120) as client,
    ):
        for count in range(1, number + 1):
            mission = client.post("/missions", json={"preset": "quick", "seed": count}).json()["id"]
            client.post(f"/missions/{mission}/start").raise_for_status()
            with client.stream("GET", f"/missions/{mission}/events/stream") as answer:
                assert any(_says_completed(line) for line in answer.iter_lines())
            client.get("/missions")
            client.get(f"/missions/{mission}/metrics")
            client.get(f"/missions/{mission}/images/observed").raise_for_status()
            httpx.get(f"{service.url}metrics", timeout=60).raise_for_status()
            if count % look_every == 0:
                time.sleep(1.0)  # until what belonged to the mission has been let go
                found.append(holding(service, data_dir, count))
    return found


def _says_completed(line: str) -> bool:
    if not line.startswith("data:"):
        return False
    event = json.loads(line.removeprefix("data:"))
    return event["kind"] == "state" and event["state"] == "completed"


def test_missions_leave_no_files_and_no_threads_behind(tmp_path):
    # The first starts what stays: the threads of the pools, the connections to the database.
    first, *_, last = run_missions(tmp_path / "data", 5, look_every=1)[1:]
    assert last.threads <= first.threads + 2
    assert last.files <= first.files + 4


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_many_missions_leave_nothing_behind_but_their_records(tmp_path, capsys):
    number = int(os.environ.get("HGS_SOAK_MISSIONS", "300"))
    found = run_missions(tmp_path / "data", number, look_every=max(1, number // 10))
    half = found[len(found) // 2 :]
    with capsys.disabled():
        sys.stdout.write("\nmissions   memory MiB   files   threads   database KiB\n")
        for one in found:
            sys.stdout.write(
                f"{one.missions:8d} {one.rss_mib:12.1f} {one.files:7d} {one.threads:9d} "
                f"{one.database_kib:14.0f}\n"
            )
        growth = np.polyfit([one.missions for one in half], [one.rss_mib for one in half], 1)[0]
        per_mission = (found[-1].database_kib - found[0].database_kib) / (number - found[0].missions)
        sys.stdout.write(
            f"memory grows by {1024 * growth:.1f} KiB a mission over the second half; the database by "
            f"{per_mission:.1f} KiB a mission\n"
        )
    assert half[-1].threads <= half[0].threads + 2
    assert half[-1].files <= half[0].files + 4
