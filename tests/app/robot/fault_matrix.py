"""Missions over a bad line: a real `hgs serve`, a real `hgs robot`, and every fault that a link can have.

Each mission meets some of `FAULTS` at random moments. Afterwards the robot must not have touched anything,
and the mission must have gone on to its end: its time limit, or everything seen.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from hgs_core.evaluation.report import MissionReport
from tests.app.crash_matrix import PATIENCE_S, Service
from tests.app.robot.bad_line import BadLine
from tests.mission.small_room import write_small_room

FAULTS: Final = (
    "cut",
    "duplicated",
    "reordered",
    "corrupted",
    "oversized",
    "nan",
    "clock",
    "robot killed",
    "service killed",
)
SHARES: Final = {"duplicated": 0.3, "reordered": 0.3, "corrupted": 0.2, "oversized": 0.05, "nan": 1.0}
STOPPING_M: Final = 0.6
"""From full speed: 1 m/s, 1.5 m/s^2, and what a control tick that comes late adds."""
SETTINGS: Final = {
    "sensor": "rgbd_5m_tiny",
    "threads": "1",
    "mesh.enabled": "false",
    "checkpoint.interval_s": "2",
    "checkpoint.most_share": "1",
    "live.dead_man_s": "1",
    "live.frame_s": "2",
}


@dataclass(kw_only=True)
class Counts:
    """What came of it."""

    missions: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    ended: Counter[str] = field(default_factory=Counter)
    """Missions by how they ended."""
    collisions: int = 0
    reconnects: int = 0
    dead_man_stops: int = 0
    longest_stop_m: float = 0.0
    wrong: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        faults = ", ".join(f"{fault} {self.faults[fault]}" for fault in FAULTS)
        ended = ", ".join(f"{n} {how}" for how, n in self.ended.items())
        return (
            f"{self.missions} missions ({ended}); faults: {faults}; {self.collisions} collisions; "
            f"{self.reconnects} reconnects; {self.dead_man_stops} stops by the dead-man's handle, the "
            f"longest over {self.longest_stop_m:.2f} m; wrong: {self.wrong or 'nothing'}"
        )


class FaultMatrix:
    def __init__(
        self, folder: Path, repository: Path, *, seed: int, time_s: float, longest_cut_s: float
    ) -> None:
        self.counts = Counts()
        self._folder = folder
        self._rng = np.random.default_rng(seed)
        self._service = Service(folder, repository)
        self._room = write_small_room(folder)
        self._time_s = time_s
        self._longest_cut_s = longest_cut_s
        self._faults: list[str] = []

    def run(self, missions: int, *, faults_each: int) -> Counts:
        self._service.begin()
        try:
            for number in range(missions):
                self._one(number, faults_each)
        finally:
            self._service.end()
        return self.counts

    def _one(self, number: int, n_faults: int) -> None:
        wish = {"scene": "live", "preset": "quick", "seed": number, "overrides": SETTINGS}
        client = self._service.client
        order = {**wish, "max_time_s": self._time_s}
        mission = client.post("/missions", json=order).raise_for_status().json()["id"]
        client.post(f"/missions/{mission}/start").raise_for_status()
        line = BadLine(self._service.port, self._rng)
        self.counts.missions += 1
        with line.up():
            robots = [self._robot(line, mission, number, 0)]
            self._until(mission, "running")
            for _ in range(n_faults):
                time.sleep(self._rng.uniform(1.0, 4.0))
                self._make(self._next_fault(), line, mission, number, robots)
                if self._state(mission) in ("stopping", "completed", "failed", "aborted"):
                    break
            line.shares.clear()
            state = self._until(mission, "completed", "failed", "aborted")
            code = robots[-1].wait(PATIENCE_S)
        self._check(mission, number, state, code, robots)

    def _make(
        self, fault: str, line: BadLine, mission: str, number: int, robots: list[subprocess.Popen]
    ) -> None:
        self.counts.faults[fault] += 1
        if fault == "cut":
            line.cut(float(np.exp(self._rng.uniform(np.log(0.1), np.log(self._longest_cut_s)))))
        elif fault == "clock":
            line.clock_s += float(self._rng.choice([-3.0, 3.0, 3600.0]))
        elif fault == "robot killed":
            robots[-1].kill()
            robots[-1].wait()
            robots.append(self._robot(line, mission, number, len(robots)))
        elif fault == "service killed":
            if self._service.kill(str(self._rng.choice(["service", "both"]))):
                state = self._until(mission, "interrupted", "completed")
                if state == "interrupted":
                    self._service.client.post(f"/missions/{mission}/resume").raise_for_status()
        else:
            line.shares = {fault: SHARES[fault]}
            time.sleep(self._rng.uniform(1.0, 3.0))
            line.shares = {}

    def _next_fault(self) -> str:
        """All in random order, then anew."""
        if not self._faults:
            self._faults = [FAULTS[place] for place in self._rng.permutation(len(FAULTS))]
        return self._faults.pop()

    def _robot(self, line: BadLine, mission: str, number: int, life: int) -> subprocess.Popen:
        out = self._folder / f"robot-{number}-{life}"
        options = {
            "server": line.url,
            "mission": mission,
            "scene": str(self._room),
            "sensor": "rgbd_5m_tiny",
            "preset": "quick",
            "seed": str(number),
            "give-up-after": str(PATIENCE_S),
            "out": str(out),
        }
        words = [word for name, value in options.items() for word in (f"--{name}", value)]
        program = "from app.cli.application import application; application()"
        with (self._folder / f"robot-{number}-{life}.log").open("wb") as output:
            return subprocess.Popen(
                [sys.executable, "-c", program, "robot", *words, "--no-evaluate"],
                stdout=output,
                stderr=output,
                env=self._service.environment,
            )

    def _state(self, mission: str) -> str:
        return str(self._service.client.get(f"/missions/{mission}").json()["state"])

    def _until(self, mission: str, *states: str) -> str:
        deadline = time.monotonic() + PATIENCE_S
        while (state := self._state(mission)) not in states:
            assert time.monotonic() < deadline, f"mission {mission} is {state}, not {states}"
            time.sleep(0.2)
        return state

    def _check(
        self, mission: str, number: int, state: str, code: int, robots: list[subprocess.Popen]
    ) -> None:
        counts = self.counts
        detail = self._service.client.get(f"/missions/{mission}").json()
        counts.ended[f"{state} ({detail['stop_reason']})"] += 1
        if state != "completed":
            counts.wrong.append(f"mission {number} is {state}: {detail['reason']}")
        if code != 0:
            log = (self._folder / f"robot-{number}-{len(robots) - 1}.log").read_text()[-500:]
            counts.wrong.append(f"the robot of mission {number} ended with {code}: {log}")
            return
        out = self._folder / f"robot-{number}-{len(robots) - 1}"
        report, robot = MissionReport.read(out / "report.json"), json.loads((out / "robot.json").read_text())
        counts.collisions += (report.collisions or 0) + int((detail["figures"] or {}).get("collisions", 0))
        counts.reconnects += robot["reconnects"]
        counts.dead_man_stops += robot["dead_man_stops"]
        counts.longest_stop_m = max([counts.longest_stop_m, *robot["dead_man_stopping_m"]])
        if counts.longest_stop_m > STOPPING_M:
            counts.wrong.append(f"mission {number}: stopped over {counts.longest_stop_m:.2f} m")
