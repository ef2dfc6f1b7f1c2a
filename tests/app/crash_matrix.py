"""Kills processes of a service at random moments, and looks at what becomes of its missions.

A real `hgs serve` with real (tiny) missions runs in processes of its own. Every mission is killed some times,
its own process, the service's, or both, and resumed each time until it has ended; then it is held against one
that nobody disturbed.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
from PIL import Image

from tests.app.crash_moments import ENDED, PATIENCE_S, STAGES, TARGETS, Moments
from tests.mission.small_room import TINY, write_small_room

MOST_A_MISSION = 5
SAME = ("trajectory.txt", "map.ply", "transforms.json")


class Service:
    """`hgs serve` on a folder, begun again whenever it has been killed."""

    def __init__(self, folder: Path, repository: Path) -> None:
        self._folder = folder
        (folder / "scenes").mkdir(parents=True)
        write_small_room(folder / "scenes")
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self._process: subprocess.Popen | None = None
        self.environment = {
            **os.environ,
            "PYTHONPATH": str(repository),
            "HGS_SCENES_DIR": str(folder / "scenes"),
        }
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}/api/v1", timeout=60)

    def begin(self) -> None:
        command = "from app.cli.application import application; application()"
        options = ("serve", "--data-dir", str(self._folder / "data"), "--port", str(self.port))
        with (self._folder / "service.log").open("ab") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-c", command, *options], env=self.environment, stdout=output, stderr=output
            )
        deadline = time.monotonic() + PATIENCE_S
        while True:
            assert self._process.poll() is None, (self._folder / "service.log").read_text()[-3000:]
            try:
                self.client.get("/missions")
            except httpx.TransportError:
                assert time.monotonic() < deadline, "the service does not answer"
                time.sleep(0.1)
            else:
                return

    def mission_process(self) -> psutil.Process | None:
        """The process of the mission that runs, if there is one."""
        assert self._process is not None
        children = psutil.Process(self._process.pid).children()
        return next((child for child in children if "spawn_main" in " ".join(_words(child))), None)

    def kill(self, target: str) -> bool:
        """Whether there was such a process."""
        assert self._process is not None
        mission = self.mission_process()
        if target == "mission" and mission is None:
            return False
        if target != "mission":
            self._process.send_signal(signal.SIGKILL)
        if target != "service" and mission is not None:
            mission.kill()
        if target != "mission":
            self._process.wait()
            self.begin()
        return True

    def end(self) -> None:
        assert self._process is not None
        self._process.terminate()
        self._process.wait(60)


def _words(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []


@dataclass(kw_only=True)
class Counts:
    """What came of it."""

    missions: int = 0
    kills: Counter[tuple[str, str]] = field(default_factory=Counter)
    """By process and by stage."""
    resumed: int = 0
    from_the_start: int = 0
    lost: int = 0
    corrupt: list[str] = field(default_factory=list)
    different: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        kills = "; ".join(
            f"{stage}: " + ", ".join(f"{self.kills[target, stage]} of {target}" for target in TARGETS)
            for stage in STAGES
        )
        return (
            f"{self.missions} missions, {self.kills.total()} kills ({kills}), "
            f"{self.resumed} resumed, {self.from_the_start} of them from the start; "
            f"{self.lost} missions lost, {len(self.corrupt)} corrupt files, "
            f"{len(self.different)} that ended differently"
        )


class CrashMatrix:
    """`run(kills)` until so many kills have hit; every mission takes up to `MOST_A_MISSION`."""

    def __init__(self, folder: Path, repository: Path, *, seed: int, time_s: float) -> None:
        self.counts = Counts()
        self._rng = np.random.default_rng(seed)
        self._service = Service(folder, repository)
        self._data = folder / "data" / "missions"
        self._time_s = time_s
        self._moments = Moments(self._rng, self._found)

    def run(self, kills: int) -> Counts:
        self._service.begin()
        try:
            undisturbed = self._new()
            self._moments.learn(undisturbed)
            self._until(undisturbed, "completed")
            self._check(undisturbed, undisturbed)
            while (left := kills - self.counts.kills.total()) > 0:
                self._one(undisturbed, most=min(left, int(self._rng.integers(1, MOST_A_MISSION + 1))))
        finally:
            self._service.end()
        return self.counts

    def _one(self, undisturbed: str, *, most: int) -> None:
        mission = self._new()
        self.counts.missions += 1
        for wanted, target in self._moments.draw(most):
            stage = self._moments.wait(mission, wanted)
            if stage == ENDED or not self._service.kill(target):
                break
            self.counts.kills[target, STAGES[stage]] += 1
            state = self._until(mission, "interrupted", "completed")
            if state == "interrupted":
                self.counts.resumed += 1
                answer = self._service.client.post(f"/missions/{mission}/resume")
                assert answer.status_code == 202, answer.text
        self._until(mission, "completed")
        self._check(mission, undisturbed)

    def _found(self, mission: str) -> dict[str, Any]:
        return self._service.client.get(f"/missions/{mission}").json()

    def _new(self) -> str:
        wish = {"scene": "room.glb", "preset": "quick", "max_time_s": self._time_s, "overrides": TINY}
        answer = self._service.client.post("/missions", json=wish)
        assert answer.status_code == 201, answer.text
        mission = answer.json()["id"]
        assert self._service.client.post(f"/missions/{mission}/start").status_code == 202
        return mission

    def _state(self, mission: str) -> str:
        return self._found(mission)["state"]

    def _until(self, mission: str, *states: str) -> str:
        deadline = time.monotonic() + PATIENCE_S
        while (state := self._state(mission)) not in states:
            if state in ("failed", "aborted") or time.monotonic() > deadline:
                self.counts.lost += 1
                raise AssertionError(self._service.client.get(f"/missions/{mission}").text)
            time.sleep(0.05)
        return state

    def _check(self, mission: str, undisturbed: str) -> None:
        run, other = self._data / mission / "run", self._data / undisturbed / "run"
        names = {path.relative_to(run).as_posix() for path in run.rglob("*") if path.is_file()}
        if names != {path.relative_to(other).as_posix() for path in other.rglob("*") if path.is_file()}:
            self.counts.different.append(f"{mission}: files {sorted(names)}")
        self.counts.different += [
            f"{mission}: {name}" for name in SAME if (run / name).read_bytes() != (other / name).read_bytes()
        ]
        self.counts.corrupt += [f"{mission}: {name}" for name in names if not _is_sound(run / name)]
        events = self._events(mission)
        if [event["sequence"] for event in events] != list(range(1, len(events) + 1)):
            self.counts.corrupt.append(f"{mission}: events have gaps")
        frames = [event["frame"] for event in events if event["kind"] == "telemetry"]
        if frames != list(range(len(frames))) or len(frames) != len(_poses(run)):
            self.counts.different.append(f"{mission}: told of the frames {frames}")
        self.counts.from_the_start += sum(e["kind"] == "resumed" and e["time_s"] == 0 for e in events)

    def _events(self, mission: str) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = []
        while True:
            after = found[-1]["sequence"] if found else 0
            query = {"limit": 1000, "after": after}
            page = self._service.client.get(f"/missions/{mission}/events", params=query).json()
            found += page["events"]
            if not page["more"]:
                return found


def _poses(run: Path) -> list[str]:
    lines = (run / "trajectory.txt").read_text().splitlines()
    return [line for line in lines if not line.startswith("#")]


def _is_sound(path: Path) -> bool:
    try:
        if path.suffix in (".jpg", ".png"):
            with Image.open(path) as image:
                image.load()
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".jsonl":
            for line in path.read_text().splitlines():
                json.loads(line)
    except (OSError, ValueError):
        return False
    return path.stat().st_size > 0
