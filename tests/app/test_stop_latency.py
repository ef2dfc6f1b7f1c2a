"""STOP, from the request to the robot that stands, while mapping and planning run flat out."""

import os
import random
import time
from dataclasses import dataclass, field

import httpx
import numpy as np
import pytest

from tests.app.load_figures import say, until_ended
from tests.app.served import served
from tests.mission.small_room import write_small_room

FLAT_OUT = {"evaluate": "false", "mesh.enabled": "false"}
"""The whole preset but for what comes after the mission."""


def new_mission(client: httpx.Client, **wish) -> str:
    wish = {"scene": "room.glb", "preset": "paper", "overrides": FLAT_OUT, **wish}
    mission = client.post("/missions", json=wish).raise_for_status().json()["id"]
    client.post(f"/missions/{mission}/start").raise_for_status()
    return mission


def until_it_plans(client: httpx.Client, mission: str) -> None:
    deadline = time.monotonic() + 600
    while (found := client.get(f"/missions/{mission}").json())["newest_plan"] is None:
        assert found["state"] in ("starting", "running"), found
        assert time.monotonic() < deadline, found
        time.sleep(0.05)


def halted_at(client: httpx.Client, mission: str) -> float:
    """Unix time at which the robot stood [s]."""
    deadline = time.monotonic() + 600
    while time.monotonic() < deadline:
        found = client.get(f"/missions/{mission}/events", params={"kind": "halted"}).json()["events"]
        if found:
            return found[0]["at_s"]
        time.sleep(0.1)
    raise AssertionError("the robot never stood")


@dataclass(kw_only=True)
class Stops:
    """What came of them."""

    took_s: list[float] = field(default_factory=list)
    """From the request to the robot that stands."""
    answered_s: list[float] = field(default_factory=list)
    """To the answer."""
    plans: list[int] = field(default_factory=list)
    """Made before."""

    def stop(self, client: httpx.Client, mission: str) -> None:
        asked_at_s = time.time()
        answer = client.post(f"/missions/{mission}/stop").raise_for_status().json()
        answered_s = time.time() - asked_at_s
        assert answer["state"] == "stopping", answer
        self.took_s.append(halted_at(client, mission) - asked_at_s)
        self.answered_s.append(answered_s)
        self.plans.append(client.get(f"/missions/{mission}/plan").json()["plan_sequence"])

    def __str__(self) -> str:
        if not self.took_s:
            return "no STOP came to its end"
        longest = ", ".join(f"{1000 * took:.0f}" for took in sorted(self.took_s)[-5:])
        return (
            f"STOP to a standing robot, {len(self.took_s)} missions of preset paper after {min(self.plans)} "
            f"to {max(self.plans)} plans: median {1000 * np.median(self.took_s):.0f} ms, p99 "
            f"{1000 * np.quantile(self.took_s, 0.99):.0f} ms, longest {longest} ms; the request alone median "
            f"{1000 * np.median(self.answered_s):.0f} ms, longest {1000 * max(self.answered_s):.0f} ms"
        )


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_stop_reaches_the_robot_while_it_maps_and_plans_flat_out(tmp_path, capsys):
    """As the mission's process reports it: both read the machine's clock.

    Every mission extends the same short one, so that it plans from its first frame on. The next one starts
    while the one before is stopped and writes its results: that is load as well.
    """
    trials = int(os.environ.get("HGS_STOP_TRIALS", "100"))
    moments = random.Random(0)
    found = Stops()
    (tmp_path / "scenes").mkdir()
    write_small_room(tmp_path / "scenes")
    with (
        served(
            tmp_path / "data",
            scenes_dir=tmp_path / "scenes",
            missions_at_once=3,
            mission_threads=3 * (os.cpu_count() or 1),
        ) as service,
        httpx.Client(base_url=service.api, timeout=120) as client,
    ):
        begun = new_mission(client, max_time_s=10)
        until_ended(client, begun)
        following = new_mission(client, extends=begun)
        try:
            for seed in range(1, trials + 1):
                mission = following
                until_it_plans(client, mission)
                if seed < trials:
                    following = new_mission(client, extends=begun, seed=seed)
                time.sleep(moments.uniform(0.0, 3.0))
                found.stop(client, mission)
        finally:
            say(capsys, str(found))
    assert np.quantile(found.took_s, 0.99) <= 0.5
